/* SPDX-License-Identifier: MIT */
#include "blw/blw_model.h"
#include <string.h>
#include "blw_cold.h"
#include "blw_la.h"

#ifdef BLW_REAL_DOUBLE
typedef uint64_t real_bits_t;
#else
typedef uint32_t real_bits_t;
#endif

/* CRC-32 of IEEE 802.3 (zlib), reflected polynomial. */
#define CRC_POLYNOMIAL 0xEDB88320U

/* Takes the number bit by bit from the low end, so that the sum is the same on every target; init
 * only, so that a table would cost more than it saves. */
static BLW_COLD uint32_t crc_real(uint32_t crc, blw_real_t value)
{
    real_bits_t bits;

    (void)memcpy(&bits, &value, sizeof bits);
    crc = ~crc;
    for (size_t bit = 0U; bit < (8U * sizeof bits); bit++) {
        const bool odd = ((crc ^ (uint32_t)bits) & 1U) != 0U;
        crc            = (crc >> 1) ^ (odd ? CRC_POLYNOMIAL : 0U);
        bits >>= 1;
    }
    return ~crc;
}

BLW_COLD void blw_table_begin(blw_table_check_t *check)
{
    check->crc = 0U;
    check->ok  = true;
}

BLW_COLD void blw_table_add(blw_table_check_t *check, const blw_real_t *table, size_t len)
{
    if (len == 0U) {
        return;
    }
    if ((table == NULL) || !blw_la_finite(len, table)) {
        check->ok = false;
        return;
    }
    for (size_t i = 0U; i < len; i++) {
        check->crc = crc_real(check->crc, table[i]);
    }
}

BLW_COLD void blw_table_add_real(blw_table_check_t *check, blw_real_t value)
{
    blw_table_add(check, &value, 1U);
}

static bool sizes_ok(const blw_plant_t *plant)
{
    return (plant->n >= 1U) && (plant->m >= 1U) && (plant->m <= BLW_MAX_SENSORS)
           && (plant->p < plant->m);
}

static bool ranges_ok(const blw_plant_t *plant)
{
    for (size_t i = 0U; i < plant->m; i++) {
        if (!(plant->y_min[i] < plant->y_max[i])) {
            return false;
        }
    }
    return true;
}

BLW_COLD blw_status_t blw_model_begin(const blw_model_t *model, blw_method_t method,
                                      blw_table_check_t *check)
{
    if ((model == NULL) || (check == NULL)) {
        return BLW_ERR_ARG;
    }
    const blw_plant_t *const plant = model->plant;
    if ((model->abi != BLW_MODEL_ABI) || (model->method != (uint8_t)method) || (plant == NULL)
        || !sizes_ok(plant)) {
        return BLW_ERR_MODEL;
    }
    const size_t n = plant->n;
    const size_t m = plant->m;
    blw_table_begin(check);
    blw_table_add(check, plant->A, n * n);
    blw_table_add(check, plant->Bu, n * plant->l);
    blw_table_add(check, plant->C, m * n);
    blw_table_add(check, plant->offset, m);
    blw_table_add(check, plant->y_min, m);
    blw_table_add(check, plant->y_max, m);
    blw_table_add(check, plant->x0, n);
    if (!check->ok || !ranges_ok(plant) || !blw_la_bounded(n, plant->x0)) {
        return BLW_ERR_MODEL;
    }
    return BLW_OK;
}

BLW_COLD blw_status_t blw_model_end(const blw_model_t *model, const blw_table_check_t *check)
{
    return (check->ok && (check->crc == model->crc)) ? BLW_OK : BLW_ERR_MODEL;
}

bool blw_plant_input_ok(const blw_plant_t *plant, const blw_real_t *u)
{
    return (u == NULL) || blw_la_bounded(plant->l, u);
}

blw_mask_t blw_plant_screen(const blw_plant_t *plant, const blw_real_t *y, blw_mask_t valid)
{
    blw_mask_t used = 0U;
    blw_mask_t bit  = 1U;

    for (size_t i = 0U; i < plant->m; i++) {
        const bool in_range = (y[i] >= plant->y_min[i]) && (y[i] <= plant->y_max[i]);

        if (in_range && (blw_la_abs(y[i]) <= BLW_SIGNAL_MAX)) {
            used |= valid & bit;
        }
        bit <<= 1;
    }
    return used;
}

void blw_plant_predict(const blw_plant_t *plant, const blw_real_t *x, const blw_real_t *u,
                       blw_real_t *x_bar)
{
    blw_la_gemv(plant->n, plant->n, plant->A, x, x_bar);
    if (u != NULL) {
        blw_la_gemv_add(plant->n, plant->l, plant->Bu, u, x_bar);
    }
    if (!blw_la_bounded(plant->n, x_bar)) {
        blw_la_copy(plant->n, plant->x0, x_bar);
    }
}

void blw_plant_innovate(const blw_plant_t *plant, const blw_real_t *y, blw_mask_t valid,
                        const blw_real_t *x_bar, blw_real_t *e)
{
    for (size_t i = 0U; i < plant->m; i++) {
        e[i] = BLW_R(0.0);
        if (((valid >> i) & 1U) != 0U) {
            const blw_real_t y_bar = blw_la_dot(plant->n, &plant->C[i * plant->n], x_bar);
            e[i]                   = (y[i] - plant->offset[i]) - y_bar;
        }
    }
}

unsigned blw_mask_count(blw_mask_t mask)
{
    unsigned count = 0U;

    for (blw_mask_t rest = mask; rest != 0U; rest &= rest - 1U) { /* clears the lowest bit */
        count++;
    }
    return count;
}
