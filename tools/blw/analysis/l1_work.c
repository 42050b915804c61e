/* SPDX-License-Identifier: MIT */
/* l1_work DRAWS OUT: what the steps of one estimator do, on a plant driven by the given draws.
 *
 * DRAWS: per step the process noise [n] and what is added to the samples [m], as double.
 * OUT: per step iterations, then calls and elements of every kernel of l1_work.h, as uint32_t.
 * The local filters are in innovation form, so that nothing changes where state and estimate move
 * together: after every step both go to x0, and a plant that is not stable stays in reach.
 * Exit status 0: all steps done; 1: a file; 3: a model or a step was refused. */
#include "l1_work.h"
#include <stdio.h>
#include WORK_MODEL_HEADER

enum { MAX_STATES = 255 };

l1_work_t l1_work[L1_KERNELS];

WORK_STORAGE(estimator);

static double state[MAX_STATES];

/* state = A state + w. */
static void advance(const blw_plant_t *plant, const double *w)
{
    double next[MAX_STATES];

    for (size_t j = 0U; j < plant->n; j++) {
        next[j] = w[j];
        for (size_t k = 0U; k < plant->n; k++) {
            next[j] += (double)plant->A[(j * plant->n) + k] * state[k];
        }
    }
    for (size_t j = 0U; j < plant->n; j++) {
        state[j] = next[j];
    }
}

static void sample(const blw_plant_t *plant, const double *v, blw_real_t *y)
{
    for (size_t i = 0U; i < plant->m; i++) {
        double sum = v[i] + (double)plant->offset[i];
        for (size_t k = 0U; k < plant->n; k++) {
            sum += (double)plant->C[(i * plant->n) + k] * state[k];
        }
        y[i] = (blw_real_t)sum;
    }
}

/* State and estimate move together, the estimate to x0. */
static void move(const blw_plant_t *plant)
{
    for (size_t j = 0U; j < plant->n; j++) {
        state[j] -= (double)estimator.x_hat[j] - (double)plant->x0[j];
        estimator.x_hat[j] = plant->x0[j];
    }
}

static bool put(const blw_estimator_out_t *out, FILE *to)
{
    const uint32_t iterations = out->iterations;

    return (fwrite(&iterations, sizeof iterations, 1U, to) == 1U)
           && (fwrite(l1_work, sizeof l1_work, 1U, to) == 1U);
}

static int run(FILE *from, FILE *to)
{
    const blw_plant_t *const plant = WORK_MODEL.head.plant;
    double                   w[MAX_STATES];
    double                   v[BLW_MAX_SENSORS];
    blw_real_t               y[BLW_MAX_SENSORS];
    blw_estimator_out_t      out;

    while ((fread(w, sizeof w[0], plant->n, from) == plant->n)
           && (fread(v, sizeof v[0], plant->m, from) == plant->m)) {
        advance(plant, w);
        sample(plant, v, y);
        for (size_t k = 0U; k < (size_t)L1_KERNELS; k++) {
            l1_work[k] = (l1_work_t){0U, 0U};
        }
        if (blw_lasso_step(&estimator, NULL, y, BLW_MASK_ALL(plant->m), &out) != BLW_OK) {
            return 3;
        }
        if (!put(&out, to)) {
            return 1;
        }
        move(plant);
    }
    return 0;
}

int main(int argc, char **argv)
{
    FILE *const from   = (argc == 3) ? fopen(argv[1], "rb") : NULL;
    FILE *const to     = (from != NULL) ? fopen(argv[2], "wb") : NULL;
    int         status = 1;

    if (to == NULL) {
        return status;
    }
    if (blw_lasso_init(&estimator, &WORK_MODEL, estimator_mem, WORK_MEM) != BLW_OK) {
        return 3;
    }
    for (size_t j = 0U; j < WORK_MODEL.head.plant->n; j++) {
        state[j] = (double)WORK_MODEL.head.plant->x0[j];
    }
    status = run(from, to);
    (void)fclose(from);
    return ((fclose(to) == 0) && (status == 0)) ? 0 : status;
}
