/* SPDX-License-Identifier: MIT */
/** @file link.h  A bus that a process is on, by its name:
 *
 *      can:vcan0  canfd:vcan0                  SocketCAN
 *      slcan:/dev/ttyUSB0  slcan:unix:PATH  slcan:tcp:HOST:PORT
 *      lcm:udpm://239.255.76.67:7667?ttl=0     lcm alone takes LCM_DEFAULT_URL
 *      replay:FILE                             a candump -L log, in its own time
 */
#ifndef BLW_SIM_LINK_H
#define BLW_SIM_LINK_H
#include "blw/blw_node.h"
#include "json_read.h"
#include <memory>
#include <string>
#include <vector>

namespace sim
{

class Link
{
public:
    Link()                        = default;
    virtual ~Link()               = default;
    Link(const Link &)            = delete;
    Link &operator=(const Link &) = delete;

    virtual blw_port_t *port() = 0;
    /** For poll(); -1 if there is nothing to wait for. */
    virtual int handle() const = 0;
    /** What is wrong with the link at present, always the same words for the same; nullptr if
     *  nothing is. */
    virtual const char *trouble() const  = 0;
    virtual Json        counters() const = 0;
    /** Nothing will ever come again. */
    virtual bool ended() const
    {
        return false;
    }
    /** Measurements, inputs and estimates in few frames or in many. */
    virtual blw_wire_format_t format() const
    {
        return BLW_WIRE_CLASSIC;
    }
    /** Whose reports are sent, for links that say more than frames do; the report outlives the
     *  link. */
    virtual void describe(const std::string & /*method*/, const blw_node_report_t & /*report*/) {}
};

/** One line on standard error when the link gets into trouble, and one when it is back. */
class Watch
{
public:
    Watch(const Link &link, std::string where) : link_(link), where_(std::move(where)) {}
    void look();

private:
    const Link &link_;
    std::string where_;
    const char *told_ = nullptr;
};

/** InputError if it cannot be opened.
 *  @param plant outlives the link
 *  @param width local states per sensor where zeta is sent, else 1 */
std::unique_ptr<Link> open_link(const std::string &where, const blw_plant_t &plant,
                                std::uint8_t width);

/** Until something can be received or the time is over. */
void wait_for(const std::vector<Link *> &links, int time_ms);

/** Send a frame, waiting for room for up to a second, but not for a lost link.
 *  @return whether it was sent. */
bool deliver(Link &link, const blw_frame_t &frame);

/** The model's id on the bus: the first 32 bits of the SHA-256 of its file. */
std::uint32_t model_id(const std::string &model_sha256);

} // namespace sim
#endif
