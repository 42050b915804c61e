/* SPDX-License-Identifier: MIT */
#include "blw/blw_jordan.h"
#include "blw_cold.h"
#include "blw_la.h"

/* The step never reads beyond zeta_i whatever J says; an entry that points there is a sign of
 * tables that were not made for this r. */
static bool edges_ok(const blw_jordan_model_t *model)
{
    const size_t r      = model->r;
    const size_t second = (r >= 2U) ? (r - 2U) : 0U;

    return !(blw_la_abs(model->J1[r - 1U]) > BLW_R(0.0))
           && !(blw_la_abs(model->J2[r - 1U]) > BLW_R(0.0))
           && !(blw_la_abs(model->J2[second]) > BLW_R(0.0))
           && !(blw_la_abs(model->Jm[0]) > BLW_R(0.0));
}

BLW_COLD blw_status_t blw_jordan_check(const blw_jordan_model_t *model, const blw_plant_t *plant,
                                       blw_table_check_t *check)
{
    if ((model == NULL) || (plant == NULL) || (check == NULL)) {
        return BLW_ERR_ARG;
    }
    if ((model->r == 0U) || (model->m != plant->m) || (model->l != plant->l)) {
        return BLW_ERR_MODEL;
    }
    const size_t r = model->r;
    const size_t N = r * model->m;
    blw_table_add(check, model->J0, r);
    blw_table_add(check, model->J1, r);
    blw_table_add(check, model->J2, r);
    blw_table_add(check, model->Jm, r);
    blw_table_add(check, model->b, N);
    blw_table_add(check, model->D, N * model->l);
    blw_table_add(check, model->G, N * plant->n);
    return (check->ok && edges_ok(model)) ? BLW_OK : BLW_ERR_MODEL;
}

BLW_COLD void blw_jordan_reset(const blw_jordan_model_t *model, size_t n, const blw_real_t *x0,
                               blw_real_t *zeta)
{
    blw_la_gemv((size_t)model->m * model->r, n, model->G, x0, zeta);
}

void blw_jordan_step_sensor(const blw_jordan_model_t *model, size_t i, const blw_real_t *u,
                            blw_real_t y_i, blw_real_t *zeta_i)
{
    const size_t            r    = model->r;
    const size_t            l    = (u != NULL) ? model->l : 0U;
    const blw_real_t *const b    = &model->b[i * r];
    blw_real_t              prev = BLW_R(0.0); /* zeta_i[j - 1] and zeta_i[j] before the step */
    blw_real_t              here = zeta_i[0];

    for (size_t j = 0U; j < r; j++) {
        const blw_real_t next  = ((j + 1U) < r) ? zeta_i[j + 1U] : BLW_R(0.0);
        const blw_real_t after = ((j + 2U) < r) ? zeta_i[j + 2U] : BLW_R(0.0);

        zeta_i[j] = (model->J0[j] * here) + (model->J1[j] * next) + (model->J2[j] * after)
                    + (model->Jm[j] * prev) + (b[j] * y_i);
        if (l > 0U) {
            zeta_i[j] += blw_la_dot(l, &model->D[((i * r) + j) * l], u);
        }
        prev = here;
        here = next;
    }
}

void blw_jordan_step(const blw_jordan_model_t *model, const blw_real_t *u, const blw_real_t *y,
                     blw_real_t *zeta)
{
    if (model->step != NULL) {
        model->step(u, y, zeta);
        return;
    }
    for (size_t i = 0U; i < model->m; i++) {
        blw_jordan_step_sensor(model, i, u, y[i], &zeta[i * model->r]);
    }
}
