/* SPDX-License-Identifier: MIT */
/** @file blw_l1_internal.h  What the parts of the l1 fusion share; not installed. */
#ifndef BLW_L1_INTERNAL_H
#define BLW_L1_INTERNAL_H
#include "blw/blw_l1.h"
#include "blw_la.h"

/* Slack of the tests on (4): what rounding leaves of l = Z z, relative to c_g + |z|, and of
 * z = Z' tau, relative to |tau|.  Near a degenerate minimum a little of it moves x_hat a lot, so it
 * is tight; in the second half of the work allowed, BLW_L1_LOOSE times as wide, so that a group on
 * the verge does not come and go for ever. */
#define BLW_L1_SLACK_Z   (BLW_R(8.0) * BLW_REAL_EPS)
#define BLW_L1_SLACK_TAU (BLW_R(0.5) * BLW_REAL_EPS)
#define BLW_L1_LOOSE     BLW_R(16.0)

/* An engine. */
struct blw_l1_ops {
    /* Whether the model has what the engine needs. */
    bool (*fits)(const blw_l1_model_t *model);
    /* Share out the memory behind tau, l and dir: step and what else the engine uses. */
    void (*lay_out)(blw_l1_t *self, blw_real_t *mem);
    /* l = S zeta. */
    void (*multiply)(blw_l1_t *self, const blw_real_t *zeta);
    /* Where the certificate fails: from l = S zeta and the last solution to tau, the best that was
     * found; l and x [n] belong to it only where info->converged says that it is the minimum. */
    void (*solve)(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x, blw_l1_info_t *info);
};

/* Row i of the trapezoid Z and its length. */
static inline const blw_real_t *blw_l1_row(const blw_l1_model_t *m, size_t i, size_t *len)
{
    *len = (i < m->d) ? (i + 1U) : m->d;
    return &m->Z[blw_la_trap_row(m->d, i)];
}

/* Rows of group g: 1 or 2. */
static inline size_t blw_l1_size(const blw_l1_model_t *m, size_t g)
{
    return (size_t)m->first[g + 1U] - (size_t)m->first[g];
}

/* Row i of the packed triangle in self->L. */
static inline blw_real_t *blw_l1_row_of_L(const blw_l1_t *self, size_t i)
{
    return &self->L[blw_la_packed_row(i)];
}

/* k-th group of the support. */
static inline size_t blw_l1_member(const blw_l1_t *self, size_t k)
{
    return (size_t)self->A[k];
}

/* |v_g| of a vector [N] of rows. */
blw_real_t blw_l1_norm(const blw_l1_model_t *m, size_t g, const blw_real_t *v);
/* |nu_g|, nu = zeta - tau. */
blw_real_t blw_l1_nu_norm(const blw_l1_t *self, const blw_real_t *zeta, size_t g);
/* Direction and length of nu_g = zeta_g - tau_g: dir_g = nu_g / |nu_g|, unchanged if nu_g = 0. */
blw_real_t blw_l1_aim(blw_l1_t *self, const blw_real_t *zeta, size_t g);
/* out = Z' v, [d]. */
void blw_l1_project(const blw_l1_model_t *m, const blw_real_t *v, blw_real_t *out);
/* l = Z z, all rows. */
void blw_l1_multipliers(blw_l1_t *self);
/* .lay_out of the engines on Z. */
void blw_l1_lay_out_Z(blw_l1_t *self, blw_real_t *mem);
/* z = Z' zeta, l = Z z: .multiply of the engines on Z. */
void blw_l1_multiply_Z(blw_l1_t *self, const blw_real_t *zeta);
/* Objective (2) at tau, with l = S tau. */
blw_real_t blw_l1_objective(const blw_l1_t *self, const blw_real_t *zeta);
/* max_g |l_g| / c_g over all groups. */
blw_real_t blw_l1_statistic(const blw_l1_t *self);
/* The group outside A that violates |l_g| <= c_g most, by more than widen times the slack, or
 * n_groups if none does. */
size_t blw_l1_worst(const blw_l1_t *self, blw_real_t widen);
/* Whether g is in A. */
bool blw_l1_in_support(const blw_l1_t *self, size_t g);

/* Support: A, tau on A, and L with L L' = Z_A Z_A' + curvature (blw_l1_support.c). */

/* Whether any group has two rows: then L has curvature and is made anew for every step. */
bool blw_l1_has_pairs(const blw_l1_model_t *m);
/* Empty A; tau = zeta. */
void blw_l1_support_clear(blw_l1_t *self, const blw_real_t *zeta);
/* Append g to A; dir_g is set.  One-row groups extend L. */
void blw_l1_support_add(blw_l1_t *self, size_t g);
/* Take member k out of A and set nu_g = 0; z follows tau.  One-row groups shrink L. */
void blw_l1_support_drop(blw_l1_t *self, const blw_real_t *zeta, size_t k);
/* Make L from scratch for A, dir and nu. */
void blw_l1_support_factor(blw_l1_t *self, const blw_real_t *zeta);
/* Newton step for (2) on A: L L' step = c dir - l, dz = Z_A' step. */
void blw_l1_support_newton(blw_l1_t *self);
/* tau_A += alpha step, z += alpha dz. */
void blw_l1_support_move(blw_l1_t *self, blw_real_t alpha);
/* |F_A step|_2: what step changes in x_hat. */
blw_real_t blw_l1_support_effect(const blw_l1_t *self);
/* max over A of |l_g - c_g dir_g| / (c_g + |z|). */
blw_real_t blw_l1_support_residual(const blw_l1_t *self);

/* Whether nu_i /= 0 in an engine that keeps the sign of nu in dir, 0 elsewhere. */
static inline bool blw_l1_clipped(const blw_l1_t *self, size_t i)
{
    return blw_la_abs(self->dir[i]) > BLW_R(0.5);
}

/* What rounding may leave of |l_i| <= c_i. */
static inline blw_real_t blw_l1_slack(blw_real_t c_i)
{
    return (BLW_R(16.0) * BLW_REAL_EPS) + ((BLW_R(16.0) * BLW_REAL_EPS) * c_i);
}

/* Whether the sizes of l outside A and the signs of nu = zeta - tau on A are those of a minimum. */
bool blw_l1_holds(const blw_l1_t *self, const blw_real_t *zeta);

/* From l outside A and nu on A, both in self->l, as the sweeps left them, to l, tau and x [n].
 * *bound = |last correction of x|, *intact: T is as it was.
 * @return whether they make a minimum. */
bool blw_l1_refine(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x, blw_real_t *bound,
                   bool *intact);

/* y = S x for S [N x N], packed. */
static inline void blw_l1_symv(const blw_l1_model_t *m, const blw_real_t *S, const blw_real_t *x,
                               blw_real_t *y)
{
    if (m->fast != NULL) {
        m->fast->symv(S, x, y);
    } else {
        blw_la_symv(m->N, S, x, y);
    }
}

/* h = -G' l, [n]: 0 at a minimum. */
void blw_l1_imbalance(const blw_l1_model_t *m, const blw_real_t *l, blw_real_t *h);
/* tau = W l + G x, [N]. */
void blw_l1_predict(const blw_l1_model_t *m, const blw_real_t *l, const blw_real_t *x,
                    blw_real_t *tau);

/* In self->L [size x size], packed lower: [W_ff G_f; G_f' 0] or the like, f rows and then the
 * columns of G, becomes its factor L J L', J = diag(I, -I).
 * @return whether the square of one of the first f pivots is below a share of the diagonal. */
bool blw_l1_factor(blw_l1_t *self, size_t f, size_t size, blw_real_t share);
/* v [size] = (L J L')^-1 v. */
void blw_l1_solve_LJL(const blw_l1_t *self, size_t f, size_t size, blw_real_t *v);

/* Solve the optimality conditions for the rows in dir and l on them: l on the others, nu in tau and
 * x [n].  *bound = |last correction of x|.  @return whether they make a minimum. */
bool blw_l1_kkt(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x, blw_real_t *bound);

/* Start from A, dir, tau and z, leave the best tau found. */
void blw_l1_active_set(blw_l1_t *self, const blw_real_t *zeta, blw_l1_info_t *info);

#endif
