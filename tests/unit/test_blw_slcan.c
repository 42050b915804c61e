/* SPDX-License-Identifier: MIT */
#include "blw/blw_slcan.h"
#include <string.h>
#include "unity.h"

static blw_slcan_t slcan;
static blw_frame_t frame;

void setUp(void)
{
    (void)memset(&slcan, 0, sizeof slcan);
    (void)memset(&frame, 0xEE, sizeof frame);
}

void tearDown(void) {}

/* All bytes of a text; the last event. */
static blw_slcan_event_t push(const char *text)
{
    blw_slcan_event_t event = BLW_SLCAN_NOTHING;

    for (size_t i = 0U; text[i] != '\0'; i++) {
        TEST_ASSERT_EQUAL_INT(BLW_SLCAN_NOTHING, event);
        event = blw_slcan_push(&slcan, (uint8_t)text[i], &frame);
    }
    return event;
}

static void test_push_given_frames_reads_them(void)
{
    const uint8_t bytes[3] = {0x01U, 0xabU, 0xffU};

    TEST_ASSERT_EQUAL_INT(BLW_SLCAN_FRAME, push("t1F3301AbfF\r"));
    TEST_ASSERT_EQUAL_HEX16(0x1f3U, frame.id);
    TEST_ASSERT_EQUAL_UINT(3U, frame.len);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(bytes, frame.data, 3U);
    TEST_ASSERT_EQUAL_INT(BLW_SLCAN_FRAME, push("\nt7ff0\r"));
    TEST_ASSERT_EQUAL_HEX16(0x7ffU, frame.id);
    TEST_ASSERT_EQUAL_UINT(0U, frame.len);
    TEST_ASSERT_EQUAL_INT(BLW_SLCAN_FRAME, push("b0809000102030405060708090a0b\r"));
    TEST_ASSERT_EQUAL_UINT(12U, frame.len);
    TEST_ASSERT_EQUAL_HEX8(0x0bU, frame.data[11]);
    TEST_ASSERT_EQUAL_INT(BLW_SLCAN_FRAME, push("t10011234F0\r")); /* 0x12 at 34F0 */
    TEST_ASSERT_EQUAL_UINT(1U, frame.len);
    TEST_ASSERT_EQUAL_UINT32(0U, slcan.malformed);
}

static void test_push_given_bad_lines_drops_and_counts_each_and_reads_the_next(void)
{
    static const char *const bad[]  = {"t\r",
                                       "t12\r",
                                       "t8000\r",
                                       "t1001\r",
                                       "t10010\r",
                                       "t1001012\r",
                                       "t100g\r",
                                       "t10010g\r",
                                       "t1009001122334455667788\r",
                                       "t1001123456789\r",
                                       "t10 100\r",
                                       "d100F00\r",
                                       "b1009\r"};
    const blw_frame_t        before = frame;

    for (size_t i = 0U; i < (sizeof bad / sizeof bad[0]); i++) {
        TEST_ASSERT_EQUAL_INT(BLW_SLCAN_MALFORMED, push(bad[i]));
        TEST_ASSERT_EQUAL_UINT32(i + 1U, slcan.malformed);
    }
    TEST_ASSERT_EQUAL_MEMORY(&before, &frame, sizeof before);
    TEST_ASSERT_EQUAL_INT(BLW_SLCAN_FRAME, push("t1000\r"));
    slcan.malformed = UINT32_MAX;
    TEST_ASSERT_EQUAL_INT(BLW_SLCAN_MALFORMED, push("t\r"));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, slcan.malformed);
}

static void test_push_given_a_line_without_end_stays_in_its_buffer(void)
{
    for (size_t i = 0U; i < 100000U; i++) {
        TEST_ASSERT_EQUAL_INT(BLW_SLCAN_NOTHING, blw_slcan_push(&slcan, (uint8_t)'t', &frame));
    }
    TEST_ASSERT_EQUAL_INT(BLW_SLCAN_MALFORMED, push("\r"));
    TEST_ASSERT_EQUAL_INT(BLW_SLCAN_FRAME, push("t1000\r"));
}

static void test_push_given_commands_and_answers_tells_them(void)
{
    TEST_ASSERT_EQUAL_INT(BLW_SLCAN_COMMAND, push("S6\r"));
    TEST_ASSERT_EQUAL_INT('S', slcan.line[0]);
    TEST_ASSERT_EQUAL_UINT(2U, slcan.len);
    TEST_ASSERT_EQUAL_INT(BLW_SLCAN_COMMAND, push("\r"));
    TEST_ASSERT_EQUAL_UINT(0U, slcan.len);
    TEST_ASSERT_EQUAL_INT(BLW_SLCAN_ERROR, push("\a"));
    TEST_ASSERT_EQUAL_INT(BLW_SLCAN_COMMAND, push("T000001000\r")); /* 29 bits: not ours */
    TEST_ASSERT_EQUAL_UINT32(0U, slcan.malformed);
}

static void test_write_given_every_length_reads_back_or_refuses(void)
{
    static const uint8_t fd[] = {12U, 16U, 20U, 24U, 32U, 48U, 64U};
    uint8_t              line[BLW_SLCAN_LINE_MAX];
    blw_frame_t          sent = {.id = 0x5a3U};
    size_t               next = 0U;

    for (uint8_t len = 0U; len <= BLW_FRAME_MAX; len++) {
        const bool fits = (len <= 8U) || (len == fd[next]);
        next += (fits && (len > 8U)) ? 1U : 0U;
        sent.len = len;
        for (uint8_t i = 0U; i < len; i++) {
            sent.data[i] = (uint8_t)(37U * (len + i));
        }
        const size_t written = blw_slcan_write(&sent, line);
        TEST_ASSERT_EQUAL_size_t(fits ? (6U + (2U * (size_t)len)) : 0U, written);
        for (size_t i = 0U; i < written; i++) {
            TEST_ASSERT_EQUAL_INT(((i + 1U) == written) ? BLW_SLCAN_FRAME : BLW_SLCAN_NOTHING,
                                  blw_slcan_push(&slcan, line[i], &frame));
        }
        if (fits) {
            TEST_ASSERT_EQUAL_HEX16(0x5a3U, frame.id);
            TEST_ASSERT_EQUAL_UINT(len, frame.len);
            TEST_ASSERT_EQUAL_INT(0, memcmp(sent.data, frame.data, len));
        }
    }
    TEST_ASSERT_EQUAL_size_t(7U, next);
    sent.len = 65U;
    TEST_ASSERT_EQUAL_size_t(0U, blw_slcan_write(&sent, line));
    sent.len = 0U;
    sent.id  = 0x800U;
    TEST_ASSERT_EQUAL_size_t(0U, blw_slcan_write(&sent, line));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_push_given_frames_reads_them);
    RUN_TEST(test_push_given_bad_lines_drops_and_counts_each_and_reads_the_next);
    RUN_TEST(test_push_given_a_line_without_end_stays_in_its_buffer);
    RUN_TEST(test_push_given_commands_and_answers_tells_them);
    RUN_TEST(test_write_given_every_length_reads_back_or_refuses);
    return UNITY_END();
}
