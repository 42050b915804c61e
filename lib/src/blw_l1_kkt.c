/* SPDX-License-Identifier: MIT */
/* Solve of the optimality conditions of (1) in blw_l1.h for a given A, in the covariance W.  With
 * mu = W l the minimiser satisfies zeta = G x + W l + nu, G' l = 0, nu_f = 0 on the rows f outside
 * A and l_A = c_A s_A on A:
 *     [ W_ff  G_f ] [ l_f ]   [ zeta_f - W_fA l_A ]
 *     [ G_f'  0   ] [ x   ] = [ -G_A' l_A         ],      nu_A = zeta_A - W_A l - G_A x.        (1)
 * It stays accurate where W is so ill-conditioned that S and its factors are not, because few rows
 * are in f; and it needs nothing of how A was found, so signs and sizes that survive it certify the
 * minimum.  The matrix is factored by blw_l1_factor.c. */
#include "blw_cold.h"
#include "blw_l1_internal.h"

/* Row and length of the factor: free rows first, then the n columns of G. */
typedef struct factor {
    size_t f;    /* rows outside A */
    size_t size; /* f + n */
} factor_t;

/* Of `count` numbers, `stride` apart, those of the rows that are not clipped. */
static void gather(const blw_l1_t *self, const blw_real_t *v, size_t stride, size_t count,
                   blw_real_t *out)
{
    size_t q = 0U;

    for (size_t j = 0U; j < count; j++) {
        if (!blw_l1_clipped(self, j)) {
            out[q] = v[j * stride];
            q++;
        }
    }
}

static BLW_APART factor_t factorise(blw_l1_t *self)
{
    const blw_l1_model_t *const m    = self->model;
    factor_t                    made = {0U, 0U};

    for (size_t i = 0U; i < m->N; i++) {
        if (!blw_l1_clipped(self, i)) {
            gather(self, &m->W[blw_la_packed_row(i)], 1U, i + 1U, blw_l1_row_of_L(self, made.f));
            made.f++;
        }
    }
    for (size_t k = 0U; k < m->n; k++) {
        blw_real_t *const Lr = blw_l1_row_of_L(self, made.f + k);
        gather(self, &m->G[k], m->n, m->N, Lr);
        blw_la_zero(k + 1U, &Lr[made.f]);
    }
    made.size = made.f + m->n;
    (void)blw_l1_factor(self, made.f, made.size, BLW_R(0.0));
    return made;
}

void blw_l1_imbalance(const blw_l1_model_t *m, const blw_real_t *l, blw_real_t *h)
{
    if (m->fast != NULL) {
        m->fast->balance(m->G, l, h);
        return;
    }
    for (size_t j = 0U; j < m->n; j++) {
        const blw_real_t *G   = &m->G[j];
        blw_real_t        sum = BLW_R(0.0);
        for (size_t i = 0U; i < m->N; i++) {
            sum += l[i] * *G;
            G += m->n;
        }
        h[j] = -sum;
    }
}

void blw_l1_predict(const blw_l1_model_t *m, const blw_real_t *l, const blw_real_t *x,
                    blw_real_t *tau)
{
    blw_l1_symv(m, m->W, l, tau);
    if (m->fast != NULL) {
        m->fast->predict(m->G, x, tau);
    } else {
        blw_la_gemv_add(m->N, m->n, m->G, x, tau);
    }
}

/* tau = W l + G x, and the residual of (1) in self->step. */
static void residual(blw_l1_t *self, const blw_real_t *zeta, const blw_real_t *x)
{
    const blw_l1_model_t *const m = self->model;
    size_t                      q = 0U;

    blw_l1_predict(m, self->l, x, self->tau);
    for (size_t i = 0U; i < m->N; i++) {
        if (!blw_l1_clipped(self, i)) {
            self->step[q] = zeta[i] - self->tau[i];
            q++;
        }
    }
    blw_l1_imbalance(m, self->l, &self->step[q]);
}

/* Correct l_f and x by the residual.  @return |dx|. */
static blw_real_t correct(blw_l1_t *self, factor_t made, blw_real_t *x)
{
    const blw_l1_model_t *const m = self->model;
    size_t                      q = 0U;

    blw_l1_solve_LJL(self, made.f, made.size, self->step);
    for (size_t i = 0U; i < m->N; i++) {
        if (!blw_l1_clipped(self, i)) {
            self->l[i] += self->step[q];
            q++;
        }
    }
    blw_la_axpy(m->n, BLW_R(1.0), &self->step[made.f], x);
    return blw_la_norm(m->n, &self->step[made.f]);
}

bool blw_l1_kkt(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x, blw_real_t *bound)
{
    const blw_l1_model_t *const m    = self->model;
    const factor_t              made = factorise(self);

    for (size_t i = 0U; i < m->N; i++) {
        self->l[i] = m->c[i] * self->dir[i];
    }
    blw_la_zero(m->n, x);
    residual(self, zeta, x);
    (void)correct(self, made, x);
    residual(self, zeta, x);
    *bound = correct(self, made, x);
    for (size_t i = 0U; i < m->N; i++) {
        self->tau[i] = blw_l1_clipped(self, i) ? self->tau[i] : zeta[i];
    }
    return blw_l1_holds(self, zeta);
}
