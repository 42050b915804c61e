/* SPDX-License-Identifier: MIT */
/** @file guard_random.h  A model of `guard` with random tables of any size, for the solver alone.
 *
 *  One state, x_ref = 0, C = 0: e = Lam eta + b y with random Lam and b.  S = Z Z' with the rows of
 *  every sensor orthonormal, so S_ii = I.  Gu = 0, so eta = e: what is tested is (2) and (3),
 *  against a dense S that is kept beside the tables.
 */
#ifndef GUARD_RANDOM_H
#define GUARD_RANDOM_H
#include <math.h>
#include <string.h>
#include "blw_guard_internal.h"
#include "support.h"

#define RANDOM_M    6U
#define RANDOM_R    8U
#define RANDOM_ROWS (RANDOM_M * RANDOM_R)
#define RANDOM_MOST 4U
#define RANDOM_MEM  BLW_GUARD_MEM(1, RANDOM_M, RANDOM_R, RANDOM_MOST)

typedef struct guard_random {
    blw_plant_t       plant;
    blw_guard_model_t model;
    double            S[RANDOM_ROWS][RANDOM_ROWS];
    blw_real_t        Lam[RANDOM_ROWS * RANDOM_R];
    blw_real_t        b[RANDOM_ROWS];
    blw_real_t        strips[RANDOM_ROWS * RANDOM_ROWS];
    blw_real_t        V[RANDOM_M * RANDOM_ROWS * RANDOM_R];
    blw_real_t        s[RANDOM_M * RANDOM_ROWS];
    blw_real_t        zeros[RANDOM_ROWS * 2U];
    blw_real_t        ones[RANDOM_M];
    blw_real_t        low[RANDOM_M];
    blw_real_t        high[RANDOM_M];
    uint16_t          unit[RANDOM_M];
    uint16_t          rank[RANDOM_M];
    uint32_t          seed;
} guard_random_t;

/** Uniform in [-1, 1). */
static inline double random_uniform(guard_random_t *made)
{
    made->seed = (made->seed * 1664525U) + 1013904223U;
    return ((double)(made->seed >> 8) / 8388608.0) - 1.0;
}

/** Z [N x d] with orthonormal rows per sensor by Gram-Schmidt, S = Z Z'. */
static inline void random_S(guard_random_t *made, size_t m, size_t r, size_t d)
{
    static double Z[RANDOM_ROWS][RANDOM_ROWS];

    for (size_t a = 0U; a < (m * r); a++) {
        for (size_t c = 0U; c < d; c++) {
            Z[a][c] = random_uniform(made);
        }
        for (size_t o = a - (a % r); o <= a; o++) {
            double dot = 0.0;
            for (size_t c = 0U; c < d; c++) {
                dot += Z[a][c] * Z[o][c];
            }
            for (size_t c = 0U; c < d; c++) {
                Z[a][c] = (o < a) ? (Z[a][c] - (dot * Z[o][c])) : (Z[a][c] / sqrt(dot));
            }
        }
        for (size_t o = 0U; o <= a; o++) {
            double dot = 0.0;
            for (size_t c = 0U; c < d; c++) {
                dot += Z[a][c] * Z[o][c];
            }
            made->S[a][o] = made->S[o][a] = dot;
        }
    }
}

/** Write M [rows x cols] in strips. */
static inline blw_real_t *random_strips(const double *M, size_t stride, size_t rows, size_t cols,
                                        blw_real_t *to)
{
    for (size_t first = 0U; first < rows; first += 3U) {
        for (size_t c = 0U; c < cols; c++) {
            for (size_t a = first; (a < rows) && (a < (first + 3U)); a++) {
                *to = (blw_real_t)M[(a * stride) + c];
                to++;
            }
        }
    }
    return to;
}

/** One rotation of random_eigen(): rows p and q of T and V, then columns p and q of T. */
static inline void random_rotate(size_t r, size_t p, size_t q, double T[RANDOM_R][RANDOM_R],
                                 double V[RANDOM_R][RANDOM_R])
{
    const double theta = (T[q][q] - T[p][p]) / (2.0 * T[p][q]);
    const double t     = copysign(1.0, theta) / (fabs(theta) + sqrt((theta * theta) + 1.0));
    const double c     = 1.0 / sqrt((t * t) + 1.0);
    const double s     = t * c;

    for (size_t j = 0U; j < r; j++) {
        const double Tp = T[p][j];
        const double Vp = V[p][j];
        T[p][j]         = (c * Tp) - (s * T[q][j]);
        T[q][j]         = (s * Tp) + (c * T[q][j]);
        V[p][j]         = (c * Vp) - (s * V[q][j]);
        V[q][j]         = (s * Vp) + (c * V[q][j]);
    }
    for (size_t j = 0U; j < r; j++) {
        const double Tp = T[j][p];
        T[j][p]         = (c * Tp) - (s * T[j][q]);
        T[j][q]         = (s * Tp) + (c * T[j][q]);
    }
}

/** Eigenvalues of T [r x r] on its diagonal, eigenvectors in the rows of V: cyclic Jacobi.  It
 *  converges quadratically; what is left of T[p][q] below 1e-12 changes no table. */
static inline void random_eigen(size_t r, double T[RANDOM_R][RANDOM_R],
                                double V[RANDOM_R][RANDOM_R])
{
    for (size_t a = 0U; a < r; a++) {
        for (size_t c = 0U; c < r; c++) {
            V[a][c] = (a == c) ? 1.0 : 0.0;
        }
    }
    for (bool rotated = true; rotated;) {
        rotated = false;
        for (size_t pair = 0U; pair < (r * r); pair++) {
            const size_t p = pair / r;
            const size_t q = pair % r;
            if ((p < q) && (fabs(T[p][q]) > 1e-12)) {
                random_rotate(r, p, q, T, V);
                rotated = true;
            }
        }
    }
}

/** V and s for every pair of sensors. */
static inline void random_pairs(guard_random_t *made, size_t m, size_t r)
{
    static double T[RANDOM_R][RANDOM_R];
    static double V[RANDOM_R][RANDOM_R];
    blw_real_t   *to = made->V;
    blw_real_t   *s  = made->s;

    for (size_t pair = 0U; pair < (m * (m - 1U)); pair++) {
        const size_t i = pair / (m - 1U);
        const size_t j = (pair % (m - 1U)) + (((pair % (m - 1U)) >= i) ? 1U : 0U);

        for (size_t a = 0U; a < r; a++) {
            for (size_t c = 0U; c < r; c++) {
                T[a][c] = (a == c) ? 1.0 : 0.0;
                for (size_t o = 0U; o < r; o++) {
                    T[a][c] -=
                        made->S[(i * r) + a][(j * r) + o] * made->S[(i * r) + c][(j * r) + o];
                }
            }
        }
        random_eigen(r, T, V);
        for (size_t a = 0U; a < r; a++) {
            for (size_t c = 0U; c < r; c++) {
                *to = (blw_real_t)V[a][c];
                to++;
            }
        }
        for (size_t c = 0U; c < r; c++) {
            *s = (blw_real_t)fmax(0.0, T[c][c]);
            s++;
        }
    }
}

/** Keep two diagonals of Lam_i below the main one, and two numbers of b_i; store them for
 *  `reach`. */
static inline void random_band(guard_random_t *made, size_t i, size_t reach)
{
    const size_t      r    = made->model.r;
    const size_t      d    = r - reach;
    blw_real_t       *Lam  = &made->Lam[i * ((r * r) - ((d * (d - 1U)) / 2U))];
    const blw_real_t *full = &made->Lam[i * r * r];
    blw_real_t       *b    = &made->b[i * reach];

    for (size_t a = 0U; a < r; a++) {
        for (size_t c = (a > reach) ? (a - reach) : 0U; c < r; c++) {
            *Lam = ((c + 2U) >= a) ? full[(a * r) + c] : BLW_R(0.0);
            Lam++;
        }
    }
    for (size_t a = 0U; a < reach; a++) {
        b[a] = (a < 2U) ? made->b[(i * r) + a] : BLW_R(0.0);
    }
}

/** Set head.crc to the sum of the tables as they are now. */
static inline void random_seal(guard_random_t *made)
{
    const blw_guard_model_t *const model  = &made->model;
    const size_t                   m      = made->plant.m;
    const size_t                   r      = model->r;
    const size_t                   below  = (r * r * m * (m - 1U)) / 2U;
    const size_t                   others = (model->pairs != 0U) ? (m * (m - 1U) * r) : 0U;
    blw_table_check_t              check;

    (void)blw_model_begin(&model->head, BLW_METHOD_GUARD, &check);
    blw_table_add(&check, model->Lam, m * blw_guard_filter_len(model));
    blw_table_add(&check, model->b, m * model->reach);
    blw_table_add(&check, model->S, below);
    blw_table_add(&check, model->V, others * r);
    blw_table_add(&check, model->s, others);
    blw_table_add(&check, model->Fu, m * r);
    blw_table_add(&check, model->Gu, m * r);
    blw_table_add(&check, model->effect, m);
    blw_table_add(&check, model->drift, m);
    blw_table_add_real(&check, model->k);
    blw_table_add_real(&check, model->exclude);
    blw_table_add_real(&check, model->gross);
    blw_table_add_real(&check, model->gain);
    blw_table_add_real(&check, model->kappa);
    blw_table_add_real(&check, model->omega);
    blw_table_add_real(&check, model->sigma);
    made->model.head.crc = check.crc;
}

/** Everything of the model that does not depend on its size. */
static inline void random_bind(guard_random_t *made, size_t r, size_t p)
{
    made->model = (blw_guard_model_t){
        .head  = {.abi = BLW_MODEL_ABI, .method = (uint8_t)BLW_METHOD_GUARD, .plant = &made->plant},
        .r     = (uint8_t)r,
        .reach = (uint8_t)r,
        .n_u   = 1U,
        .n_units = made->plant.m,
        .most    = (uint8_t)RANDOM_MOST,
        .pairs   = (p == 1U) ? 1U : 0U,
        .unit    = made->unit,
        .rank    = made->rank,
        .Lam     = made->Lam,
        .b       = made->b,
        .S       = made->strips,
        .V       = made->V,
        .s       = made->s,
        .Fu      = made->zeros,
        .Gu      = made->zeros,
        .effect  = made->ones,
        .drift   = made->ones,
        .k       = BLW_R(2.0),
        .exclude = BLW_R(3.0),
        .gross   = BLW_R(128.0),
        .gain    = BLW_R(0.125),
        .kappa   = BLW_R(1.0),
        .omega   = BLW_R(1.0),
        .solver  = &blw_guard_many_ops};
    made->model.max_updates = 200U;
}

/** m sensors with r states each, of which p may be excluded; d = rank of S, at least r. */
static inline void random_make(guard_random_t *made, size_t m, size_t r, size_t d, size_t p)
{
    memset(made, 0, sizeof *made);
    made->seed = (uint32_t)((m * 1000U) + (r * 100U) + d);
    random_S(made, m, r, d);
    blw_real_t *to = made->strips;
    for (size_t i = 1U; i < m; i++) {
        to = random_strips(&made->S[i * r][0], RANDOM_ROWS, r, i * r, to);
    }
    random_pairs(made, m, r);
    for (size_t a = 0U; a < (m * r); a++) {
        made->b[a] = (blw_real_t)random_uniform(made);
        for (size_t c = 0U; c < r; c++) {
            made->Lam[(a * r) + c] = (blw_real_t)(0.5 * random_uniform(made) / (double)r);
        }
    }
    for (size_t i = 0U; i < m; i++) {
        made->ones[i] = BLW_R(1.0);
        made->low[i]  = -BLW_REAL_MAX;
        made->high[i] = BLW_REAL_MAX;
        made->unit[i] = (uint16_t)i;
        made->rank[i] = (uint16_t)r;
    }
    made->plant = (blw_plant_t){.n      = 1U,
                                .m      = (uint8_t)m,
                                .p      = (uint8_t)p,
                                .A      = made->zeros,
                                .C      = made->zeros,
                                .offset = made->zeros,
                                .y_min  = made->low,
                                .y_max  = made->high,
                                .x0     = made->zeros};
    random_bind(made, r, p);
    random_seal(made);
}

#endif
