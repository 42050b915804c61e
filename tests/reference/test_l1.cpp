// SPDX-License-Identifier: MIT
// The l1 fusion against optimality conditions and an ADMM of Eigen's, on random problems.
#include <algorithm>
#include <cstdio>
#include <limits>

#include "random_l1.h"

namespace
{

using reference::Problem;
using reference::Vector;

int failures = 0;

void expect(bool ok, const char *what, unsigned seed, double value)
{
    if (!ok) {
        std::printf("FAIL %s, seed %u: %g\n", what, seed, value);
        ++failures;
    }
}

constexpr int    GUARD     = 64; // numbers behind the memory, which stay NaN
constexpr bool   is_double = (sizeof(blw_real_t) == 8);
constexpr double tolerance = is_double ? 1e-9 : 3e-3; // relative to thresholds of size 1

// The library on one problem; holds state and memory, so that solves start warm.
class Solver
{
public:
    Solver(const Problem &problem, const blw_l1_ops_t *engine, int max_iterations)
        : model_(problem.model(engine, max_iterations)),
          memory_(BLW_L1_MEM(model_.N, model_.d, model_.n_groups) + GUARD,
                  std::numeric_limits<blw_real_t>::quiet_NaN())
    {
        blw_l1_init(&state_, &model_, memory_.data());
    }

    Vector solve(const Vector &zeta)
    {
        const std::vector<blw_real_t> z(zeta.data(), zeta.data() + zeta.size());
        std::vector<blw_real_t>       x(model_.n);
        blw_l1_solve(&state_, z.data(), x.data(), &info);
        expect(std::all_of(memory_.end() - GUARD, memory_.end(),
                           [](blw_real_t value) { return std::isnan(value); }),
               "nothing is written behind the memory", 0, double(model_.N));
        return Eigen::Map<Eigen::Matrix<blw_real_t, Eigen::Dynamic, 1>>(x.data(), model_.n)
            .cast<double>();
    }

    Vector tau() const
    {
        return Eigen::Map<Eigen::Matrix<blw_real_t, Eigen::Dynamic, 1>>(state_.tau, model_.N)
            .cast<double>();
    }

    blw_l1_info_t info{};

private:
    blw_l1_model_t          model_;
    blw_l1_t                state_{};
    std::vector<blw_real_t> memory_;
};

// What the library gets to see of a sample.
Vector rounded(const Vector &zeta)
{
    return zeta.cast<blw_real_t>().cast<double>();
}

void check_solution(Problem &problem, Solver &solver, unsigned seed, double attack)
{
    const Vector zeta = rounded(problem.sample(attack));
    const Vector x    = solver.solve(zeta);

    expect(solver.info.converged, "converged", seed, solver.info.iterations);
    if (solver.info.kalman) {
        expect((x - problem.kalman(zeta)).norm() < tolerance, "certified estimate", seed, 0.0);
        expect(solver.info.iterations == 0, "certificate iterates", seed, 0.0);
        return;
    }
    const double violation = problem.violation(zeta, solver.tau());
    expect(violation < tolerance, "optimality", seed, violation);
    if (attack <= 10.0) { // beyond, Eigen's ADMM would need more passes than a test should take
        const double error = (x - problem.solve(zeta, 4000)).norm();
        expect(error < 10.0 * tolerance, "distance to Eigen's ADMM", seed, error);
    }
}

// A solve cut short says how far off it may be, and that is true.
void check_bound(Problem &problem, unsigned seed, const blw_l1_ops_t *engine)
{
    for (int iterations = 1; iterations <= 8; ++iterations) {
        Solver       cut(problem, engine, iterations);
        Solver       full(problem, engine, 1000);
        const Vector zeta = rounded(problem.sample(5.0));
        const double e    = (cut.solve(zeta) - full.solve(zeta)).norm();
        expect(std::isfinite(cut.info.bound), "bound is finite", seed, cut.info.bound);
        expect(e <= cut.info.bound * (1.0 + tolerance) + tolerance, "error bound", seed, e);
        expect(cut.info.iterations <= iterations, "iterations", seed, cut.info.iterations);
    }
}

// The engine that the design tool chooses.
const blw_l1_ops_t *engine_in_W(bool pairs)
{
    return pairs ? &blw_l1_newton_ops : &blw_l1_tableau_ops;
}

void check_problem(unsigned seed, const std::vector<int> &sizes, int n)
{
    for (const double threshold : {0.3, 1.0, 3.0}) {
        Problem    problem(seed, sizes, n, threshold);
        const bool pairs = std::size_t(problem.rows()) != sizes.size();
        for (const blw_l1_ops_t *engine :
             {&blw_l1_active_set_ops, &blw_l1_admm_ops, engine_in_W(pairs)}) {
            Solver solver(problem, engine, (engine == &blw_l1_newton_ops) ? 64 : 3000);
            for (int k = 0; k < 6; ++k) {
                check_solution(problem, solver, seed, (k % 3 == 2) ? 100.0 : 2.0 * k);
            }
        }
        check_bound(problem, seed, &blw_l1_active_set_ops);
        check_bound(problem, seed, engine_in_W(pairs));
    }
}

// Rows of Z that are nearly dependent and thresholds far below the attack: whatever the support,
// the objective does not rise above where it starts, nu = 0.
void check_descent(unsigned seed, const std::vector<int> &sizes, int n,
                   const blw_l1_ops_t *engine = &blw_l1_active_set_ops)
{
    for (const double least : {1e-3, 1e-5, 1e-10}) {
        Problem problem(seed, sizes, n, 1e-3, least);
        Solver  solver(problem, engine, 8 * problem.rows());
        for (int k = 0; k < 40; ++k) {
            const Vector zeta  = rounded(problem.sample((k % 4 == 3) ? 100.0 : 1.0));
            const Vector x     = solver.solve(zeta);
            const double start = problem.objective(zeta, zeta);
            const double end   = problem.objective(zeta, solver.tau());
            expect(x.allFinite(), "estimate is finite", seed, x.norm());
            expect(end <= 1.01 * start, "objective does not rise", seed, end / start);
        }
    }
}

// Many minimisers, pivots that are nothing but rounding: finite, and within the memory.
void check_degenerate(unsigned seed, int sensors, int n)
{
    for (const double threshold : {0.01, 0.1, 0.5}) {
        Problem problem(seed, std::vector<int>(static_cast<std::size_t>(sensors * n), 1), n, 1.0);
        problem.make_degenerate(threshold);
        for (const blw_l1_ops_t *engine : {&blw_l1_active_set_ops, &blw_l1_admm_ops}) {
            Solver solver(problem, engine, 1000);
            for (int k = 0; k < 10; ++k) {
                const Vector x = solver.solve(rounded(problem.sample(k % 3)));
                expect(x.allFinite(), "degenerate estimate is finite", seed, x.norm());
            }
        }
    }
}

} // namespace

int main()
{
    for (unsigned seed = 1; seed <= 25; ++seed) {
        check_problem(seed, std::vector<int>(4 + seed % 12, 1), 1 + int(seed % 3));
        std::vector<int> mixed;
        for (unsigned g = 0; g < 4 + seed % 5; ++g) {
            mixed.push_back((g + seed) % 3 == 0 ? 1 : 2);
        }
        check_problem(seed, mixed, 2 + int(seed % 2));
        check_problem(seed, std::vector<int>(3 + seed % 4, 2), 2);
        check_descent(seed, std::vector<int>(12 + seed % 20, 1), 3);
        check_descent(seed, std::vector<int>(6 + seed % 10, 2), 4);
        check_descent(seed, std::vector<int>(6 + seed % 10, 2), 4, &blw_l1_newton_ops);
        check_degenerate(seed, 4, 2 + int(seed % 3));
    }
    std::printf("%d failures\n", failures);
    return (failures == 0) ? 0 : 1;
}
