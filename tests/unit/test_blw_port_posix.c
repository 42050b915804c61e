/* SPDX-License-Identifier: MIT */
/* Back ends without their buses: SLCAN over a socket pair, a candump log, LCM in memory. */
#include "blw_port_replay.h"
#include "blw_port_serial.h"
#include "blw/blw_wire.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>
#ifdef BLW_WITH_LCM
#include "blw_port_lcm.h"
#endif
#include "support.h"

#define FRAMES 10000U

static blw_port_serial_t one;
static blw_port_serial_t other;

void setUp(void)
{
    int ends[2];

    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_STREAM, 0, ends));
    TEST_ASSERT_EQUAL_INT(0, blw_port_serial_adopt(&one, ends[0]));
    TEST_ASSERT_EQUAL_INT(0, blw_port_serial_adopt(&other, ends[1]));
}

void tearDown(void)
{
    blw_port_serial_close(&one);
    blw_port_serial_close(&other);
}

static void make(size_t number, blw_frame_t *frame)
{
    frame->id  = (uint16_t)(number % 2048U);
    frame->len = (uint8_t)(((number % 10U) == 9U) ? 64U : (number % 9U));
    for (size_t i = 0U; i < frame->len; i++) {
        frame->data[i] = (uint8_t)((number * 31U) + i);
    }
}

static void assert_frame(size_t number, const blw_frame_t *frame)
{
    blw_frame_t expected;

    make(number, &expected);
    TEST_ASSERT_EQUAL_HEX16(expected.id, frame->id);
    TEST_ASSERT_EQUAL_UINT(expected.len, frame->len);
    TEST_ASSERT_EQUAL_INT(0, memcmp(expected.data, frame->data, frame->len));
}

static void test_serial_given_many_frames_loses_and_reorders_none(void)
{
    size_t      sent     = 0U;
    size_t      received = 0U;
    blw_frame_t frame;

    while (received < FRAMES) {
        make(sent, &frame);
        while ((sent < FRAMES) && blw_port_send(&one.base, &frame)) {
            sent++;
            make(sent, &frame);
        }
        while (blw_port_recv(&other.base, &frame)) {
            assert_frame(received, &frame);
            received++;
        }
        TEST_ASSERT_FALSE(blw_port_recv(&one.base, &frame)); /* lets it flush */
    }
    TEST_ASSERT_EQUAL_UINT64(FRAMES, one.counters.sent);
    TEST_ASSERT_EQUAL_UINT64(FRAMES, other.counters.received);
    TEST_ASSERT_TRUE(one.counters.no_room > 0U); /* the line was full, and nothing was lost */
    TEST_ASSERT_EQUAL_UINT32(0U, other.slcan.malformed);
}

static void test_serial_given_commands_answers_them_as_an_adapter_does(void)
{
    static const char commands[] = "C\rS6\rO\r";
    blw_frame_t       frame;
    char              answer[8] = {0};

    TEST_ASSERT_EQUAL_INT(8, (int)write(blw_port_serial_handle(&one), commands, 8U));
    TEST_ASSERT_FALSE(blw_port_recv(&other.base, &frame));
    TEST_ASSERT_FALSE(blw_port_recv(&other.base, &frame));
    TEST_ASSERT_EQUAL_INT(3, (int)read(blw_port_serial_handle(&one), answer, sizeof answer));
    TEST_ASSERT_EQUAL_STRING("\r\r\r", answer);
}

static void test_serial_given_a_peer_that_goes_reports_the_loss(void)
{
    blw_frame_t frame = {.id = 1U};

    blw_port_serial_close(&one);
    TEST_ASSERT_FALSE(blw_port_recv(&other.base, &frame));
    TEST_ASSERT_TRUE(other.down);
    TEST_ASSERT_EQUAL_UINT64(1U, other.counters.lost);
    TEST_ASSERT_FALSE(blw_port_send(&other.base, &frame)); /* and there is no signal */
    TEST_ASSERT_EQUAL_INT(-1, blw_port_serial_handle(&other));
}

static int listen_on(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int          fd      = socket(AF_UNIX, SOCK_STREAM, 0);

    (void)strncpy(address.sun_path, path, sizeof address.sun_path - 1U);
    TEST_ASSERT_EQUAL_INT(0, bind(fd, (const struct sockaddr *)&address, sizeof address));
    TEST_ASSERT_EQUAL_INT(0, listen(fd, 1));
    return fd;
}

static void test_serial_given_a_peer_that_comes_back_recovers(void)
{
    const struct timespec wait     = {.tv_nsec = 1000L * (long)BLW_POSIX_RETRY_US};
    char                  folder[] = "/tmp/blw_serial.XXXXXX";
    char                  path[40];
    char                  place[48];
    blw_port_serial_t     port;
    blw_frame_t           frame;

    TEST_ASSERT_NOT_NULL(mkdtemp(folder));
    (void)snprintf(path, sizeof path, "%s/line", folder);
    (void)snprintf(place, sizeof place, "unix:%s", path);
    const int server = listen_on(path);
    TEST_ASSERT_EQUAL_INT(0, blw_port_serial_open(&port, place));
    (void)close(accept(server, NULL, NULL));
    TEST_ASSERT_FALSE(blw_port_recv(&port.base, &frame));
    TEST_ASSERT_TRUE(port.down);
    (void)nanosleep(&wait, NULL);
    TEST_ASSERT_FALSE(blw_port_recv(&port.base, &frame)); /* opens it again */
    TEST_ASSERT_FALSE(port.down);
    const int peer = accept(server, NULL, NULL);
    TEST_ASSERT_EQUAL_INT(8, (int)write(peer, "t1011FF\r", 8U));
    TEST_ASSERT_TRUE(blw_port_recv(&port.base, &frame));
    TEST_ASSERT_EQUAL_HEX16(0x101U, frame.id);
    TEST_ASSERT_EQUAL_UINT64(1U, port.counters.lost);
    blw_port_serial_close(&port);
    (void)close(peer);
    (void)close(server);
    (void)unlink(path);
    (void)rmdir(folder);
}

static void test_serial_open_given_no_such_place_refuses(void)
{
    static const char *const places[] = {"unix:/nonexistent/socket", "/nonexistent/line",
                                         "somewhere", "tcp:nowhere"};

    for (size_t i = 0U; i < (sizeof places / sizeof places[0]); i++) {
        blw_port_serial_t port;
        TEST_ASSERT_TRUE(blw_port_serial_open(&port, places[i]) > 0);
        TEST_ASSERT_EQUAL_INT(-1, blw_port_serial_handle(&port));
    }
}

static void test_replay_given_a_log_yields_its_frames_in_its_time(void)
{
    static const char text[] = "(100.000001) vcan0 101#0102 R\r\n"
                               "(100.000003) vcan0 090##10A0B0C0D0E0F000102030405\n"
                               "(100.000004) vcan0 12345678#00\n"
                               "(100.000005) vcan0 123#R\n"
                               "not a frame\n"
                               "(100.000005) vcan0 800#00\n"
                               "(100.5) vcan0 101#00\n"
                               "(99999999999999999999.000000) vcan0 101#00\n"
                               "(100.000005) vcan0 101#001\n"
                               "(100.000005) vcan0 101#000102030405060708\n"
                               "(100.000005) vcan0 101##\n"
                               "(100.000005) vcan0 101\n"
                               "(100.000005) vcan0 101#00 X\n"
                               "(100.000002) vcan0 7FF# T\n";
    char              path[] = "/tmp/blw_replay.XXXXXX";
    const int         fd     = mkstemp(path);
    blw_port_replay_t port;
    blw_frame_t       frame;

    TEST_ASSERT_EQUAL_INT((int)sizeof text - 1, (int)write(fd, text, sizeof text - 1U));
    (void)close(fd);
    TEST_ASSERT_EQUAL_INT(0, blw_port_replay_open(&port, path));
    (void)unlink(path);
    TEST_ASSERT_EQUAL_UINT64(100000001U, blw_port_now_us(&port.base));
    TEST_ASSERT_TRUE(blw_port_recv(&port.base, &frame));
    TEST_ASSERT_EQUAL_HEX16(0x101U, frame.id);
    TEST_ASSERT_EQUAL_UINT(2U, frame.len);
    TEST_ASSERT_EQUAL_HEX8(2U, frame.data[1]);
    TEST_ASSERT_EQUAL_UINT64(100000003U, blw_port_now_us(&port.base));
    TEST_ASSERT_TRUE(blw_port_recv(&port.base, &frame));
    TEST_ASSERT_EQUAL_UINT(12U, frame.len);
    TEST_ASSERT_EQUAL_HEX8(5U, frame.data[11]);
    TEST_ASSERT_TRUE(blw_port_recv(&port.base, &frame));
    TEST_ASSERT_EQUAL_HEX16(0x7ffU, frame.id);
    TEST_ASSERT_EQUAL_UINT64(100000003U, frame.t_us); /* time does not go back */
    TEST_ASSERT_FALSE(blw_port_recv(&port.base, &frame));
    TEST_ASSERT_TRUE(port.ended);
    TEST_ASSERT_EQUAL_UINT64(11U, port.skipped);
    TEST_ASSERT_TRUE(blw_port_send(&port.base, &frame));
    blw_port_replay_close(&port);
    TEST_ASSERT_TRUE(blw_port_replay_open(&port, "/nonexistent/log") > 0);
}

#ifdef BLW_WITH_LCM
static blw_port_lcm_t lcm;

static void lcm_send(blw_wire_kind_t kind, uint16_t seq, size_t count)
{
    blw_wire_values_t values = {
        .kind = (uint8_t)kind, .count = (uint8_t)count, .seq = seq, .valid = 5U};
    blw_frame_t frame;

    for (size_t j = 0U; j < count; j++) {
        values.value[j] = 0.5F + (float)j;
    }
    TEST_ASSERT_TRUE(blw_wire_put_values(&values, BLW_WIRE_FD, &frame));
    TEST_ASSERT_TRUE(blw_port_send(&lcm.base, &frame));
}

static void lcm_expect(blw_wire_kind_t kind, uint16_t seq, size_t count)
{
    blw_wire_values_t values;
    blw_frame_t       frame;

    TEST_ASSERT_TRUE(blw_port_recv(&lcm.base, &frame));
    TEST_ASSERT_EQUAL_INT(BLW_WIRE_OK, blw_wire_get_values(&frame, &values));
    TEST_ASSERT_EQUAL_INT(kind, values.kind);
    TEST_ASSERT_EQUAL_UINT(count, values.count);
    TEST_ASSERT_EQUAL_HEX16(seq, values.seq);
    TEST_ASSERT_EQUAL_FLOAT(0.5F + (float)(count - 1U), values.value[count - 1U]);
}

static void test_lcm_given_frames_of_every_kind_hears_them_again(void)
{
    const blw_wire_sync_t sync = {.k = 70000U, .model = 0x123456U};
    blw_wire_sync_t       back;
    support_kalman_t      made;
    blw_frame_t           frame;

    support_kalman_make(&made);
    TEST_ASSERT_TRUE(blw_port_lcm_open(&lcm, "memq://", &made.plant, 2U));
    TEST_ASSERT_TRUE(blw_port_lcm_handle(&lcm) >= 0);
    blw_wire_put_sync(&sync, &frame);
    TEST_ASSERT_TRUE(blw_port_send(&lcm.base, &frame));
    TEST_ASSERT_TRUE(blw_port_recv(&lcm.base, &frame));
    TEST_ASSERT_EQUAL_INT(BLW_WIRE_OK, blw_wire_get_sync(&frame, &back));
    TEST_ASSERT_EQUAL_MEMORY(&sync, &back, sizeof sync);
    lcm_send(BLW_WIRE_MEASUREMENT, 70000U % 65536U, 3U);
    lcm_expect(BLW_WIRE_MEASUREMENT, 70000U % 65536U, 3U);
    lcm_send(BLW_WIRE_INPUT, 70000U % 65536U, 1U);
    lcm_expect(BLW_WIRE_INPUT, 70000U % 65536U, 1U);
    lcm_send(BLW_WIRE_ZETA, 70000U % 65536U, 2U);
    lcm_expect(BLW_WIRE_ZETA, 70000U % 65536U, 2U);
    TEST_ASSERT_FALSE(blw_port_recv(&lcm.base, &frame));
    TEST_ASSERT_EQUAL_UINT64(4U, lcm.counters.sent);
    blw_port_lcm_close(&lcm);
}

static void test_lcm_given_messages_of_wrong_dimensions_yields_bad_frames(void)
{
    static const char *const channels[] = {"BLW_SYNC", "BLW_MEASUREMENT", "BLW_INPUT", "BLW_ZETA",
                                           "BLW_ESTIMATE"};
    uint8_t                  bytes[64];
    support_kalman_t         made;
    blw_frame_t              frame;
    blw_wire_values_t        values;

    support_kalman_make(&made);
    TEST_ASSERT_TRUE(blw_port_lcm_open(&lcm, "memq://", &made.plant, 1U));
    (void)memset(bytes, 0xFF, sizeof bytes); /* dimensions of -1, were they read */
    for (size_t i = 0U; i < 5U; i++) {
        for (unsigned len = 1U; len <= sizeof bytes; len += 9U) {
            TEST_ASSERT_EQUAL_INT(0, lcm_publish(lcm.lcm, channels[i], bytes, len));
            TEST_ASSERT_TRUE(blw_port_recv(&lcm.base, &frame));
            TEST_ASSERT_EQUAL_INT(BLW_WIRE_ERR_LAYOUT, blw_wire_get_values(&frame, &values));
        }
    }
    TEST_ASSERT_EQUAL_UINT64(40U, lcm.counters.malformed);
    TEST_ASSERT_EQUAL_UINT64(0U, lcm.counters.received);
    blw_port_lcm_close(&lcm);
    TEST_ASSERT_FALSE(blw_port_lcm_open(&lcm, "nothing://", &made.plant, 1U));
}
#endif

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_serial_given_many_frames_loses_and_reorders_none);
    RUN_TEST(test_serial_given_commands_answers_them_as_an_adapter_does);
    RUN_TEST(test_serial_given_a_peer_that_goes_reports_the_loss);
    RUN_TEST(test_serial_given_a_peer_that_comes_back_recovers);
    RUN_TEST(test_serial_open_given_no_such_place_refuses);
    RUN_TEST(test_replay_given_a_log_yields_its_frames_in_its_time);
#ifdef BLW_WITH_LCM
    RUN_TEST(test_lcm_given_frames_of_every_kind_hears_them_again);
    RUN_TEST(test_lcm_given_messages_of_wrong_dimensions_yields_bad_frames);
#endif
    return UNITY_END();
}
