/* SPDX-License-Identifier: MIT */
/* The solver of `guard` on random tables of every size: the optimality conditions (3) of
 * blw_guard.h, evaluated in double with a dense S, and the bound on updates. */
#include "blw_guard_internal.h"
#include "guard_random.h"

static guard_random_t      made;
static blw_real_t          mem[RANDOM_MEM];
static blw_guard_t         guard;
static blw_estimator_out_t out;

void setUp(void) {}
void tearDown(void) {}

static void start(void)
{
    random_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_guard_init(&guard, &made.model, mem, RANDOM_MEM));
}

/* One step with noise on all sensors and 10^(0..size) on some of them. */
static void step(size_t attacked, double size)
{
    blw_real_t   y[RANDOM_M];
    const size_t m     = made.plant.m;
    const size_t first = (size_t)((random_uniform(&made) + 1.0) * 0.5 * (double)m);

    for (size_t i = 0U; i < m; i++) {
        const double scale = (((i + m - first) % m) < attacked)
                                 ? pow(10.0, size * fabs(random_uniform(&made)))
                                 : 0.0;
        y[i]               = (blw_real_t)((scale + 1.0) * 2.0 * random_uniform(&made));
    }
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_guard_step(&guard, NULL, y, BLW_MASK_ALL(m), &out));
    TEST_ASSERT_TRUE(out.iterations <= made.model.max_updates);
}

/* The largest violation of l_i = min(1, k_i / |h_i|) h_i, which is (3), relative to k. */
static double violation(const blw_real_t *tau)
{
    const size_t r     = made.model.r;
    double       worst = 0.0;

    for (size_t i = 0U; i < made.plant.m; i++) {
        const double k = guard_has(out.excluded, i) ? 0.0 : (double)made.model.k;
        double       l[RANDOM_R];
        double       h[RANDOM_R];
        double       square = 0.0;

        for (size_t a = 0U; a < r; a++) {
            l[a] = 0.0;
            for (size_t c = 0U; c < (made.plant.m * r); c++) {
                l[a] += made.S[(i * r) + a][c] * (double)tau[c];
            }
            h[a] = l[a] + ((double)guard.e[(i * r) + a] - (double)tau[(i * r) + a]);
            square += h[a] * h[a];
        }
        const double shrink = (square > (k * k)) ? (k / sqrt(square)) : 1.0;
        for (size_t a = 0U; a < r; a++) {
            worst = fmax(worst, fabs((shrink * h[a]) - l[a]));
        }
    }
    return worst / (double)made.model.k;
}

/* Solve once more from the state that the step has left in e, and look at tau before it is
 * fused. */
static double violation_of_step(bool *converged)
{
    *converged = out.outcome != (uint8_t)BLW_OUTCOME_BOUND;
    if (out.outcome == (uint8_t)BLW_OUTCOME_KALMAN) {
        return violation(guard.e);
    }
    blw_guard_multipliers(&made.model, guard.e, guard.l);
    blw_guard_squares(&made.model, guard.l, guard.h);
    for (size_t i = 0U; i < made.plant.m; i++) {
        guard.h[i] = (blw_real_t)sqrt((double)guard.h[i]);
    }
    guard.attacked = 0U;
    guard.excluded = 0U;
    guard.updates  = 0U;
    (void)made.model.solver->solve(&guard, converged);
    const double found = violation(guard.eta);
    memcpy(guard.eta, guard.e, made.plant.m * made.model.r * sizeof guard.e[0]);
    return found;
}

static void assert_optimal(size_t steps, size_t attacked, double size)
{
    unsigned solved = 0U;

    for (size_t k = 0U; k < steps; k++) {
        bool converged = false;

        step(attacked, size);
        const double found = violation_of_step(&converged);
        if (converged) {
            TEST_ASSERT_REAL_WITHIN(3e-4, 0.0, found);
            solved++;
        }
    }
    TEST_ASSERT_TRUE(solved > (steps / 2U));
}

static void test_step_given_any_size_solves_to_the_optimum(void)
{
    for (size_t r = 1U; r <= RANDOM_R; r++) {
        random_make(&made, 5U, r, (3U * r) + 1U, 1U);
        start();
        assert_optimal(60U, 1U, 2.0);
        made.model.solver = &blw_guard_one_ops; /* one sensor after the other */
        start();
        assert_optimal(60U, 1U, 2.0);
        made.model.solver = &blw_guard_many_ops;
        made.model.pairs  = 0U; /* by block updates and Newton steps alone */
        start();
        assert_optimal(60U, 1U, 2.0);
    }
}

static void test_step_given_two_attackers_excludes_them_jointly(void)
{
    for (size_t r = 1U; r <= 4U; r++) {
        random_make(&made, 6U, r, (4U * r) + 1U, 2U);
        start();
        assert_optimal(60U, 2U, 2.0);
        made.model.search = 1U;
        start();
        assert_optimal(60U, 3U, 1.5);
    }
}

static void test_step_during_warm_up_solves_without_exclusion(void)
{
    const blw_guard_solver_t *const solvers[2] = {&blw_guard_many_ops, &blw_guard_one_ops};

    for (size_t pass = 0U; pass < 2U; pass++) {
        random_make(&made, 5U, 3U, 9U, 1U);
        made.model.solver  = solvers[pass];
        made.model.warm_up = 1000U;
        start();
        assert_optimal(200U, 3U, 1.0);
        TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
    }
}

static void test_step_given_any_bound_keeps_to_it(void)
{
    for (size_t pass = 0U; pass < 3U; pass++) {
        const size_t p = (pass == 2U) ? 2U : 1U;

        random_make(&made, 6U, 3U, 12U, p);
        made.model.solver = (pass == 0U) ? &blw_guard_one_ops : &blw_guard_many_ops;
        for (uint16_t most = 1U; most <= 24U; most++) {
            made.model.max_updates = most;
            made.model.search      = ((p == 2U) && ((most % 3U) == 0U)) ? 1U : 0U;
            start();
            for (size_t k = 0U; k < 100U; k++) {
                step(1U + (k % 6U), 4.0);
                TEST_ASSERT_TRUE(out.bound >= BLW_R(0.0));
                TEST_ASSERT_TRUE(out.bound <= BLW_REAL_MAX);
            }
        }
    }
}

static void test_step_given_units_counts_them_as_one(void)
{
    random_make(&made, 6U, 2U, 9U, 1U);
    made.model.pairs   = 0U;
    made.model.n_units = 3U;
    for (size_t i = 0U; i < 6U; i++) {
        made.unit[i] = (uint16_t)(i / 2U);
    }
    start();
    for (size_t k = 0U; k < 200U; k++) {
        step(2U, 3.0);
        const blw_mask_t set = out.excluded;
        TEST_ASSERT_TRUE((set == 0U) || (set == 3U) || (set == 12U) || (set == 48U));
    }
}

static void test_step_given_unchecked_directions_keeps_them_out(void)
{
    random_make(&made, 5U, 3U, 9U, 1U);
    for (size_t i = 0U; i < 5U; i++) { /* the last direction of sensor 1 is checked by nobody */
        made.rank[i] = (i == 1U) ? 2U : 3U;
    }
    for (size_t a = 0U; a < 15U; a++) {
        made.S[5][a] = made.S[a][5] = 0.0;
    }
    blw_real_t *to = made.strips;
    for (size_t i = 1U; i < 5U; i++) {
        to = random_strips(&made.S[i * 3U][0], RANDOM_ROWS, 3U, i * 3U, to);
    }
    random_pairs(&made, 5U, 3U);
    made.model.pairs = 0U;
    start();
    for (size_t k = 0U; k < 200U; k++) {
        step(2U, 2.0);
        TEST_ASSERT_TRUE(out.bound <= BLW_REAL_MAX);
        TEST_ASSERT_REAL_WITHIN(0.0, 0.0, guard.l[5]);
    }
}

static void test_step_given_a_band_computes_the_same_bits_as_without(void)
{
    blw_real_t found[2][40];

    for (size_t pass = 0U; pass < 2U; pass++) {
        random_make(&made, 5U, 4U, 13U, 1U);
        for (size_t i = 0U; i < 5U; i++) {
            random_band(&made, i, (pass == 0U) ? 4U : 2U);
        }
        made.model.reach = (pass == 0U) ? 4U : 2U;
        start();
        for (size_t k = 0U; k < 40U; k++) {
            step(1U, 1.0);
            found[pass][k] = out.statistic;
        }
    }
    TEST_ASSERT_EQUAL_MEMORY(found[0], found[1], sizeof found[0]);
}

static void test_step_given_a_stiff_pair_ends_the_search_for_mu(void)
{
    random_make(&made, 5U, 2U, 9U, 1U);
    for (size_t c = 0U; c < 40U; c++) { /* no reason to stop but the number of steps */
        made.s[c] = (c % 2U == 0U) ? BLW_R(1e-12) : BLW_R(1.0);
    }
    start();
    for (size_t k = 0U; k < 200U; k++) {
        step(3U, 12.0);
        TEST_ASSERT_TRUE(out.bound <= BLW_REAL_MAX);
        TEST_ASSERT_TRUE((out.x_hat[0] <= BLW_SIGNAL_MAX) && (out.x_hat[0] >= -BLW_SIGNAL_MAX));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_step_given_any_size_solves_to_the_optimum);
    RUN_TEST(test_step_given_two_attackers_excludes_them_jointly);
    RUN_TEST(test_step_during_warm_up_solves_without_exclusion);
    RUN_TEST(test_step_given_any_bound_keeps_to_it);
    RUN_TEST(test_step_given_units_counts_them_as_one);
    RUN_TEST(test_step_given_a_band_computes_the_same_bits_as_without);
    RUN_TEST(test_step_given_a_stiff_pair_ends_the_search_for_mu);
    RUN_TEST(test_step_given_unchecked_directions_keeps_them_out);
    return UNITY_END();
}
