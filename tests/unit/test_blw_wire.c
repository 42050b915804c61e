/* SPDX-License-Identifier: MIT */
/* The expected bytes come from an independent encoder in Python (struct, bit-by-bit CRC-8). */
#include "blw/blw_wire.h"
#include <math.h>
#include <string.h>
#include "unity.h"

static blw_frame_t frame;

void setUp(void)
{
    (void)memset(&frame, 0xEE, sizeof frame);
}

void tearDown(void) {}

static void assert_frame(uint16_t id, size_t len, const uint8_t *data)
{
    TEST_ASSERT_EQUAL_HEX16(id, frame.id);
    TEST_ASSERT_EQUAL_size_t(len, frame.len);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(data, frame.data, len);
}

static void test_put_sync_given_a_step_writes_the_documented_bytes(void)
{
    const uint8_t         bytes[8] = {0x04, 0x03, 0x02, 0x01, 0xd8, 0xb5, 0xeb, 0xc6};
    const blw_wire_sync_t sync     = {.k = 0x01020304U, .model = 0xf6ebb5d8U};
    blw_wire_sync_t       back;

    blw_wire_put_sync(&sync, &frame);
    assert_frame(0x080U, 8U, bytes);
    TEST_ASSERT_EQUAL_INT(BLW_WIRE_OK, blw_wire_get_sync(&frame, &back));
    TEST_ASSERT_EQUAL_HEX32(sync.k, back.k);
    TEST_ASSERT_EQUAL_HEX32(0xebb5d8U, back.model);
}

static void assert_values(const blw_wire_values_t *values, blw_wire_format_t format, uint16_t id,
                          size_t len, const uint8_t *data)
{
    blw_wire_values_t back;

    TEST_ASSERT_TRUE(blw_wire_put_values(values, format, &frame));
    assert_frame(id, len, data);
    TEST_ASSERT_EQUAL_INT(BLW_WIRE_OK, blw_wire_get_values(&frame, &back));
    TEST_ASSERT_EQUAL_INT(values->kind, back.kind);
    TEST_ASSERT_EQUAL_UINT(values->sensor, back.sensor);
    TEST_ASSERT_EQUAL_UINT(values->first, back.first);
    TEST_ASSERT_EQUAL_UINT(values->count, back.count);
    TEST_ASSERT_EQUAL_HEX16(values->valid, back.valid);
    TEST_ASSERT_EQUAL_MEMORY(values->value, back.value, sizeof(float) * values->count);
}

static void test_put_values_given_classic_writes_the_documented_bytes(void)
{
    const uint8_t           measurement[8] = {0x00, 0x00, 0xc0, 0x3f, 0xcd, 0xab, 0x01, 0x58};
    const uint8_t           zeta[8]        = {0x00, 0x00, 0x00, 0xc0, 0x07, 0x00, 0x07, 0xcf};
    const uint8_t           estimate[8]    = {0x00, 0x00, 0xc0, 0x3f, 0x00, 0x00, 0x00, 0xc0};
    const blw_wire_values_t y_2            = {.kind  = BLW_WIRE_MEASUREMENT,
                                              .first = 2U,
                                              .count = 1U,
                                              .seq   = 0xabcdU,
                                              .valid = 1U,
                                              .value = {1.5F}};
    const blw_wire_values_t zeta_53        = {.kind   = BLW_WIRE_ZETA,
                                              .sensor = 5U,
                                              .first  = 3U,
                                              .count  = 1U,
                                              .seq    = 7U,
                                              .valid  = 1U,
                                              .value  = {-2.0F}};
    const blw_wire_values_t x_67           = {
                  .kind = BLW_WIRE_ESTIMATE, .first = 6U, .count = 2U, .valid = 3U, .value = {1.5F, -2.0F}};

    assert_values(&y_2, BLW_WIRE_CLASSIC, 0x102U, 8U, measurement);
    assert_values(&zeta_53, BLW_WIRE_CLASSIC, 0x145U, 8U, zeta);
    assert_values(&x_67, BLW_WIRE_CLASSIC, 0x203U, 8U, estimate);
}

static void test_put_values_given_fd_writes_the_documented_bytes(void)
{
    const uint8_t some[20]    = {0xcd, 0xab, 0x05, 0x00, 0x03, 0x00, 0x00, 0xae, 0x00, 0x00,
                                 0xc0, 0x3f, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xc0};
    const uint8_t five[32]    = {0x09, 0x00, 0x1f, 0x00, 0x05, 0x00, 0x00, 0xc2, 0x00, 0x00, 0x80,
                                 0x3f, 0x00, 0x00, 0x00, 0x40, 0x00, 0x00, 0x40, 0x40, 0x00, 0x00,
                                 0x80, 0x40, 0x00, 0x00, 0xa0, 0x40, 0x00, 0x00, 0x00, 0x00};
    const blw_wire_values_t y = {.kind  = BLW_WIRE_MEASUREMENT,
                                 .first = 14U,
                                 .count = 3U,
                                 .seq   = 0xabcdU,
                                 .valid = 5U,
                                 .value = {1.5F, 0.0F, -2.0F}};
    const blw_wire_values_t zeta = {.kind   = BLW_WIRE_ZETA,
                                    .sensor = 5U,
                                    .first  = 14U,
                                    .count  = 5U,
                                    .seq    = 9U,
                                    .valid  = 0x1fU,
                                    .value  = {1.0F, 2.0F, 3.0F, 4.0F, 5.0F}};

    assert_values(&y, BLW_WIRE_FD, 0x091U, 20U, some);
    assert_values(&zeta, BLW_WIRE_FD, 0x345U, 32U, five);
}

static void test_put_values_given_every_index_and_format_reads_back_and_ids_differ(void)
{
    static const uint8_t kinds[]    = {BLW_WIRE_MEASUREMENT, BLW_WIRE_INPUT, BLW_WIRE_ESTIMATE,
                                       BLW_WIRE_ZETA};
    static const size_t  most[]     = {64U, 128U, 255U, 64U};
    static uint8_t       used[2048] = {0U};

    for (size_t c = 0U; c < 8U; c++) {
        const uint8_t           kind   = kinds[c / 2U];
        const blw_wire_format_t format = ((c % 2U) == 0U) ? BLW_WIRE_CLASSIC : BLW_WIRE_FD;
        const size_t            span   = blw_wire_span((blw_wire_kind_t)kind, format);

        for (size_t first = 0U; first < most[c / 2U]; first += span) {
            const size_t      left   = most[c / 2U] - first;
            blw_wire_values_t values = {.kind  = kind,
                                        .first = (uint8_t)first,
                                        .count = (uint8_t)((left < span) ? left : span)};
            blw_wire_values_t back;

            values.value[values.count - 1U] = (float)first;
            TEST_ASSERT_TRUE(blw_wire_put_values(&values, format, &frame));
            TEST_ASSERT_EQUAL_INT(kind, blw_wire_kind(&frame));
            TEST_ASSERT_EQUAL_INT(BLW_WIRE_OK, blw_wire_get_values(&frame, &back));
            TEST_ASSERT_EQUAL_UINT(first, back.first);
            TEST_ASSERT_EQUAL_UINT(values.count, back.count);
            TEST_ASSERT_EQUAL_FLOAT((float)first, back.value[back.count - 1U]);
            used[frame.id]++;
            TEST_ASSERT_TRUE((used[frame.id] == 1U) || (kind == BLW_WIRE_ZETA));
        }
    }
}

static void test_put_values_given_what_no_frame_holds_refuses(void)
{
    const blw_wire_values_t bad[] = {
        {.kind = BLW_WIRE_SYNC, .count = 1U},
        {.kind = BLW_WIRE_FOREIGN, .count = 1U},
        {.kind = BLW_WIRE_MEASUREMENT, .count = 0U},
        {.kind = BLW_WIRE_MEASUREMENT, .count = 2U},
        {.kind = BLW_WIRE_MEASUREMENT, .first = 64U, .count = 1U},
        {.kind = BLW_WIRE_INPUT, .first = 128U, .count = 1U},
        {.kind = BLW_WIRE_ESTIMATE, .first = 1U, .count = 1U},
        {.kind = BLW_WIRE_ESTIMATE, .first = 254U, .count = 2U},
        {.kind = BLW_WIRE_ZETA, .first = 64U, .count = 1U},
        {.kind = BLW_WIRE_ZETA, .sensor = 64U, .count = 1U},
    };
    const blw_wire_values_t too_many = {.kind = BLW_WIRE_INPUT, .count = 15U};
    const blw_frame_t       before   = frame;

    for (size_t i = 0U; i < (sizeof bad / sizeof bad[0]); i++) {
        TEST_ASSERT_FALSE(blw_wire_put_values(&bad[i], BLW_WIRE_CLASSIC, &frame));
    }
    TEST_ASSERT_FALSE(blw_wire_put_values(&too_many, BLW_WIRE_FD, &frame));
    TEST_ASSERT_EQUAL_MEMORY(&before, &frame, sizeof before);
}

static void test_put_status_given_a_report_writes_the_documented_bytes(void)
{
    const uint8_t            bytes[8] = {0x34, 0x12, 0x01, 0x03, 0x11, 0xff, 0x77, 0x19};
    const uint8_t            bits[8]  = {0x34, 0x12, 0x01, 0x02, 0x04, 0x08, 0x00, 0xab};
    const blw_wire_status_t  status   = {.seq        = 0x1234U,
                                         .outcome    = 1U,
                                         .flags      = 3U,
                                         .events     = 0x11U,
                                         .iterations = 255U,
                                         .estimate   = 0x77U};
    const blw_wire_sensors_t sensors  = {.seq        = 0x1234U,
                                         .group      = 2U,
                                         .excluded   = 1U,
                                         .missing    = 2U,
                                         .rejected   = 4U,
                                         .suspicious = 8U};
    blw_wire_status_t        status_back;
    blw_wire_sensors_t       sensors_back;
    blw_frame_t              again;

    blw_wire_put_status(&status, &frame);
    assert_frame(0x280U, 8U, bytes);
    TEST_ASSERT_EQUAL_INT(BLW_WIRE_OK, blw_wire_get_status(&frame, &status_back));
    blw_wire_put_status(&status_back, &again);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(bytes, again.data, 8U);
    blw_wire_put_sensors(&sensors, &frame);
    assert_frame(0x283U, 8U, bits);
    TEST_ASSERT_EQUAL_INT(BLW_WIRE_OK, blw_wire_get_sensors(&frame, &sensors_back));
    blw_wire_put_sensors(&sensors_back, &again);
    assert_frame(again.id, 8U, again.data);
}

static void test_sum_values_given_two_floats_is_the_crc_of_their_bytes(void)
{
    const float values[2] = {1.5F, -2.0F};

    TEST_ASSERT_EQUAL_HEX8(0x7fU, blw_wire_sum_values(0U, values, 2U));
    TEST_ASSERT_EQUAL_HEX8(
        0x7fU, blw_wire_sum_values(blw_wire_sum_values(0U, values, 1U), &values[1], 1U));
}

/* Every getter on the frame as it is; only the one of its kind may look further than the id. */
static blw_wire_result_t decode(void)
{
    blw_wire_sync_t    sync;
    blw_wire_values_t  values;
    blw_wire_status_t  status;
    blw_wire_sensors_t sensors;

    switch (blw_wire_kind(&frame)) {
    case BLW_WIRE_SYNC:
        return blw_wire_get_sync(&frame, &sync);
    case BLW_WIRE_STATUS:
        return blw_wire_get_status(&frame, &status);
    case BLW_WIRE_SENSOR_BITS:
        return blw_wire_get_sensors(&frame, &sensors);
    case BLW_WIRE_MEASUREMENT:
    case BLW_WIRE_INPUT:
    case BLW_WIRE_ESTIMATE:
    case BLW_WIRE_ZETA:
        return blw_wire_get_values(&frame, &values);
    case BLW_WIRE_FOREIGN:
    default:
        TEST_ASSERT_EQUAL_INT(BLW_WIRE_ERR_KIND, blw_wire_get_sync(&frame, &sync));
        TEST_ASSERT_EQUAL_INT(BLW_WIRE_ERR_KIND, blw_wire_get_status(&frame, &status));
        TEST_ASSERT_EQUAL_INT(BLW_WIRE_ERR_KIND, blw_wire_get_sensors(&frame, &sensors));
        return blw_wire_get_values(&frame, &values);
    }
}

static void make(uint8_t kind, blw_wire_format_t format, size_t count)
{
    blw_wire_values_t values = {.kind = kind, .count = (uint8_t)count, .seq = 5U};

    for (size_t j = 0U; j < count; j++) {
        values.value[j] = 0.5F;
    }
    TEST_ASSERT_TRUE(blw_wire_put_values(&values, format, &frame));
}

static void test_get_given_any_single_bit_error_refuses(void)
{
    const blw_wire_sync_t    sync    = {.k = 77U, .model = 0x123456U};
    const blw_wire_status_t  status  = {.seq = 3U, .estimate = 9U};
    const blw_wire_sensors_t sensors = {.seq = 3U, .group = 7U};

    for (size_t c = 0U; c < 6U; c++) {
        if (c == 0U) {
            blw_wire_put_sync(&sync, &frame);
        } else if (c == 1U) {
            blw_wire_put_status(&status, &frame);
        } else if (c == 2U) {
            blw_wire_put_sensors(&sensors, &frame);
        } else if (c == 3U) {
            make(BLW_WIRE_MEASUREMENT, BLW_WIRE_CLASSIC, 1U);
        } else {
            make(BLW_WIRE_ZETA, BLW_WIRE_FD, (c == 4U) ? 1U : 14U);
        }
        TEST_ASSERT_EQUAL_INT(BLW_WIRE_OK, decode());
        for (size_t bit = 0U; bit < (8U * (size_t)frame.len); bit++) {
            frame.data[bit / 8U] ^= (uint8_t)(1U << (bit % 8U));
            TEST_ASSERT_TRUE(decode() < BLW_WIRE_OK);
            frame.data[bit / 8U] ^= (uint8_t)(1U << (bit % 8U));
        }
        frame.id ^= 1U; /* a frame of another sensor, or of nobody */
        TEST_ASSERT_TRUE(decode() < BLW_WIRE_OK);
    }
}

static void test_get_given_any_other_length_refuses(void)
{
    make(BLW_WIRE_INPUT, BLW_WIRE_CLASSIC, 1U);
    for (unsigned len = 0U; len <= UINT8_MAX; len++) {
        frame.len = (uint8_t)len;
        TEST_ASSERT_EQUAL_INT((len == 8U) ? BLW_WIRE_OK : BLW_WIRE_ERR_LAYOUT, decode());
    }
    make(BLW_WIRE_INPUT, BLW_WIRE_FD, 5U);
    for (unsigned len = 0U; len <= UINT8_MAX; len++) {
        frame.len = (uint8_t)len;
        TEST_ASSERT_EQUAL_INT((len == 32U) ? BLW_WIRE_OK : BLW_WIRE_ERR_LAYOUT, decode());
    }
    make(BLW_WIRE_ESTIMATE, BLW_WIRE_CLASSIC, 2U);
    for (unsigned len = 0U; len <= UINT8_MAX; len++) {
        frame.len = (uint8_t)len;
        TEST_ASSERT_EQUAL_INT(((len == 8U) || (len == 4U)) ? BLW_WIRE_OK : BLW_WIRE_ERR_LAYOUT,
                              decode());
    }
    frame.id  = 0x200U + 127U; /* x_hat 254 and 255, of which the second cannot be */
    frame.len = 8U;
    TEST_ASSERT_EQUAL_INT(BLW_WIRE_ERR_LAYOUT, decode());
}

static void test_kind_given_every_identifier_knows_only_ours(void)
{
    size_t ours = 0U;

    for (unsigned id = 0U; id <= UINT16_MAX; id++) {
        frame.id  = (uint16_t)id;
        frame.len = 0U;
        TEST_ASSERT_TRUE(decode() < BLW_WIRE_OK);
        ours += (blw_wire_kind(&frame) != BLW_WIRE_FOREIGN) ? 1U : 0U;
    }
    TEST_ASSERT_EQUAL_size_t(1U + 5U + 10U + 19U + 64U + 64U + 128U + 128U + 1U + 8U + 320U, ours);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_put_sync_given_a_step_writes_the_documented_bytes);
    RUN_TEST(test_put_values_given_classic_writes_the_documented_bytes);
    RUN_TEST(test_put_values_given_fd_writes_the_documented_bytes);
    RUN_TEST(test_put_values_given_every_index_and_format_reads_back_and_ids_differ);
    RUN_TEST(test_put_values_given_what_no_frame_holds_refuses);
    RUN_TEST(test_put_status_given_a_report_writes_the_documented_bytes);
    RUN_TEST(test_sum_values_given_two_floats_is_the_crc_of_their_bytes);
    RUN_TEST(test_get_given_any_single_bit_error_refuses);
    RUN_TEST(test_get_given_any_other_length_refuses);
    RUN_TEST(test_kind_given_every_identifier_knows_only_ours);
    return UNITY_END();
}
