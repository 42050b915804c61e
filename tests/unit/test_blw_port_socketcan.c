/* SPDX-License-Identifier: MIT */
/* SocketCAN without a bus: a socket pair carries what the kernel would, error frames among it. */
#include "blw_port_socketcan.h"
#include <linux/can.h>
#include <linux/can/error.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include "support.h"

static blw_port_socketcan_t port;
static int                  bus;

void setUp(void)
{
    int ends[2];

    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_DGRAM, 0, ends));
    TEST_ASSERT_EQUAL_INT(0, blw_port_socketcan_adopt(&port, ends[0], true));
    bus = ends[1];
}

void tearDown(void)
{
    blw_port_socketcan_close(&port);
    (void)close(bus);
}

/* The bus carries a frame of 8 bytes. */
static void carry(uint32_t id)
{
    struct can_frame frame;

    (void)memset(&frame, 0, sizeof frame);
    frame.can_id  = id;
    frame.can_dlc = 8U;
    TEST_ASSERT_EQUAL_INT((int)sizeof frame, (int)write(bus, &frame, sizeof frame));
}

static void carry_error(uint32_t what)
{
    carry(CAN_ERR_FLAG | what);
}

static void expect_nothing(void)
{
    blw_frame_t frame;

    TEST_ASSERT_FALSE(blw_port_recv(&port.base, &frame));
}

static void expect_frame(uint16_t id)
{
    blw_frame_t frame;

    TEST_ASSERT_TRUE(blw_port_recv(&port.base, &frame));
    TEST_ASSERT_EQUAL_HEX16(id, frame.id);
}

static void test_recv_given_bus_off_reports_it_once_and_restart_ends_it(void)
{
    carry_error(CAN_ERR_BUSOFF);
    carry_error(CAN_ERR_BUSOFF | CAN_ERR_CRTL);
    expect_nothing();
    TEST_ASSERT_TRUE(port.bus_off);
    TEST_ASSERT_EQUAL_UINT64(1U, port.counters.bus_off);
    carry_error(CAN_ERR_RESTARTED);
    expect_nothing();
    TEST_ASSERT_FALSE(port.bus_off);
    carry_error(CAN_ERR_BUSOFF);
    expect_nothing();
    TEST_ASSERT_TRUE(port.bus_off);
    TEST_ASSERT_EQUAL_UINT64(2U, port.counters.bus_off);
    TEST_ASSERT_EQUAL_UINT64(0U, port.counters.errors);
    TEST_ASSERT_EQUAL_UINT64(0U, port.counters.lost);
}

static void test_recv_given_a_frame_after_bus_off_is_on_the_bus_again(void)
{
    carry_error(CAN_ERR_BUSOFF);
    carry(0x123U);
    expect_frame(0x123U);
    TEST_ASSERT_FALSE(port.bus_off);
    TEST_ASSERT_EQUAL_UINT64(1U, port.counters.bus_off);
}

static void test_recv_given_other_errors_counts_them_and_stays_on_the_bus(void)
{
    static const uint32_t errors[] = {CAN_ERR_TX_TIMEOUT, CAN_ERR_LOSTARB, CAN_ERR_CRTL,
                                      CAN_ERR_PROT,       CAN_ERR_TRX,     CAN_ERR_ACK,
                                      CAN_ERR_BUSERROR};
    static const size_t   count    = sizeof errors / sizeof errors[0];

    for (size_t i = 0U; i < count; i++) {
        carry_error(errors[i]);
    }
    carry(0x7FFU);
    expect_frame(0x7FFU);
    TEST_ASSERT_FALSE(port.bus_off);
    TEST_ASSERT_EQUAL_UINT64(count, port.counters.errors);
    TEST_ASSERT_EQUAL_UINT64(0U, port.counters.bus_off);
    TEST_ASSERT_EQUAL_UINT64(1U, port.counters.received);
}

static void test_recv_given_foreign_frames_skips_and_counts_them(void)
{
    carry(CAN_EFF_FLAG | 0x123U);
    carry(CAN_RTR_FLAG | 0x123U);
    carry(0x124U);
    expect_frame(0x124U);
    expect_nothing();
    TEST_ASSERT_EQUAL_UINT64(2U, port.counters.foreign);
    TEST_ASSERT_EQUAL_UINT64(1U, port.counters.received);
}

static void test_send_given_short_and_long_frames_writes_both_kinds(void)
{
    blw_frame_t        frame = {.id = 0x101U, .len = 8U, .data = {1U, 2U}};
    struct canfd_frame raw;

    TEST_ASSERT_TRUE(blw_port_send(&port.base, &frame));
    TEST_ASSERT_EQUAL_INT((int)CAN_MTU, (int)read(bus, &raw, sizeof raw));
    TEST_ASSERT_EQUAL_HEX32(0x101U, raw.can_id);
    TEST_ASSERT_EQUAL_HEX8(2U, raw.data[1]);
    frame.len = 12U;
    TEST_ASSERT_TRUE(blw_port_send(&port.base, &frame));
    TEST_ASSERT_EQUAL_INT((int)CANFD_MTU, (int)read(bus, &raw, sizeof raw));
    TEST_ASSERT_EQUAL_UINT(12U, raw.len);
    port.can_fd = false;
    TEST_ASSERT_FALSE(blw_port_send(&port.base, &frame));
    TEST_ASSERT_EQUAL_UINT64(2U, port.counters.sent);
}

static void test_send_given_a_full_queue_says_so_and_loses_nothing(void)
{
    const blw_frame_t frame = {.id = 0x101U, .len = 8U};
    struct can_frame  raw;
    uint64_t          sent = 0U;

    while (blw_port_send(&port.base, &frame)) {
        sent++;
    }
    TEST_ASSERT_EQUAL_UINT64(1U, port.counters.no_room);
    TEST_ASSERT_EQUAL_UINT64(0U, port.counters.lost);
    TEST_ASSERT_FALSE(port.down);
    for (uint64_t taken = 0U; taken < sent; taken++) {
        TEST_ASSERT_EQUAL_INT((int)sizeof raw, (int)read(bus, &raw, sizeof raw));
    }
    TEST_ASSERT_TRUE(blw_port_send(&port.base, &frame));
}

static void test_open_given_no_such_interface_refuses(void)
{
    blw_port_socketcan_t other;

    TEST_ASSERT_TRUE(blw_port_socketcan_open(&other, "no_such_if", false) > 0);
    TEST_ASSERT_TRUE(blw_port_socketcan_open(&other, "a_name_that_is_too_long", false) > 0);
    TEST_ASSERT_EQUAL_INT(-1, blw_port_socketcan_handle(&other));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_recv_given_bus_off_reports_it_once_and_restart_ends_it);
    RUN_TEST(test_recv_given_a_frame_after_bus_off_is_on_the_bus_again);
    RUN_TEST(test_recv_given_other_errors_counts_them_and_stays_on_the_bus);
    RUN_TEST(test_recv_given_foreign_frames_skips_and_counts_them);
    RUN_TEST(test_send_given_short_and_long_frames_writes_both_kinds);
    RUN_TEST(test_send_given_a_full_queue_says_so_and_loses_nothing);
    RUN_TEST(test_open_given_no_such_interface_refuses);
    return UNITY_END();
}
