/* SPDX-License-Identifier: MIT */
#include "link.h"
#include "blw_port_replay.h"
#include "blw_port_serial.h"
#include "blw_port_socketcan.h"
#include "error.h"
#include <cerrno>
#include <cstring>
#include <iostream>
#include <poll.h>
#ifdef BLW_WITH_LCM
#include "blw_port_lcm.h"
#endif

namespace sim
{
namespace
{

const int           ROOM_MS    = 1;
const int           ROOM_TRIES = 1000;
const unsigned long ID_DIGITS  = 8U;
const char *const   LOST       = "link lost";

[[noreturn]] void refuse(const std::string &where, int error)
{
    throw InputError(where + ": cannot be opened: " + std::strerror(error));
}

/* What the links have in common: a port of C that is closed in the end. */
template <class Port, void (*CLOSE)(Port *)> class PortLink : public Link
{
public:
    ~PortLink() override
    {
        CLOSE(&port_);
    }
    blw_port_t *port() override
    {
        return &port_.base;
    }

protected:
    Port port_{};
};

class CanLink : public PortLink<blw_port_socketcan_t, blw_port_socketcan_close>
{
public:
    CanLink(const std::string &where, const std::string &interface, bool can_fd) : can_fd_(can_fd)
    {
        const int error = blw_port_socketcan_open(&port_, interface.c_str(), can_fd);
        if (error != 0) {
            refuse(where, error);
        }
    }
    int handle() const override
    {
        return blw_port_socketcan_handle(&port_);
    }
    const char *trouble() const override
    {
        return port_.down ? LOST : (port_.bus_off ? "bus off" : nullptr);
    }
    Json counters() const override
    {
        const blw_socketcan_counters_t &c = port_.counters;
        return {{"sent", c.sent},       {"received", c.received}, {"foreign", c.foreign},
                {"no_room", c.no_room}, {"overruns", c.overruns}, {"bus_off", c.bus_off},
                {"errors", c.errors},   {"lost", c.lost}};
    }
    blw_wire_format_t format() const override
    {
        return can_fd_ ? BLW_WIRE_FD : BLW_WIRE_CLASSIC;
    }

private:
    bool can_fd_;
};

class SerialLink : public PortLink<blw_port_serial_t, blw_port_serial_close>
{
public:
    SerialLink(const std::string &where, const std::string &place)
    {
        const int error = blw_port_serial_open(&port_, place.c_str());
        if (error != 0) {
            refuse(where, error);
        }
    }
    int handle() const override
    {
        return blw_port_serial_handle(&port_);
    }
    const char *trouble() const override
    {
        return port_.down ? LOST : nullptr;
    }
    Json counters() const override
    {
        const blw_serial_counters_t &c = port_.counters;
        return {{"sent", c.sent},       {"received", c.received},
                {"no_room", c.no_room}, {"refused", c.refused},
                {"lost", c.lost},       {"malformed", port_.slcan.malformed}};
    }
};

class ReplayLink : public PortLink<blw_port_replay_t, blw_port_replay_close>
{
public:
    ReplayLink(const std::string &where, const std::string &path)
    {
        const int error = blw_port_replay_open(&port_, path.c_str());
        if (error != 0) {
            refuse(where, error);
        }
    }
    int handle() const override
    {
        return -1;
    }
    const char *trouble() const override
    {
        return nullptr;
    }
    bool ended() const override
    {
        return port_.ended;
    }
    Json counters() const override
    {
        return {{"skipped", port_.skipped}};
    }
};

#ifdef BLW_WITH_LCM
class LcmLink : public PortLink<blw_port_lcm_t, blw_port_lcm_close>
{
public:
    LcmLink(const std::string &where, std::string url, const blw_plant_t &plant, std::uint8_t width)
        : url_(std::move(url))
    {
        if (!blw_port_lcm_open(&port_, url_.empty() ? nullptr : url_.c_str(), &plant, width)) {
            throw InputError(where + ": cannot be opened: LCM refuses it");
        }
    }
    int handle() const override
    {
        return blw_port_lcm_handle(&port_);
    }
    const char *trouble() const override
    {
        return port_.down ? LOST : nullptr;
    }
    Json counters() const override
    {
        const blw_lcm_counters_t &c = port_.counters;
        return {{"sent", c.sent},
                {"received", c.received},
                {"malformed", c.malformed},
                {"lost", c.lost}};
    }
    blw_wire_format_t format() const override
    {
        return BLW_WIRE_FD;
    }
    void describe(const std::string &method, const blw_node_report_t &report) override
    {
        method_ = method;
        blw_port_lcm_describe(&port_, method_.c_str(), &report);
    }

private:
    std::string url_, method_;
};
#endif

std::unique_ptr<Link> open_lcm(const std::string &where, const std::string &rest,
                               const blw_plant_t &plant, std::uint8_t width)
{
#ifdef BLW_WITH_LCM
    return std::make_unique<LcmLink>(where, rest, plant, width);
#else
    (void)rest;
    (void)plant;
    (void)width;
    throw InputError(where
                     + ": this program was built without LCM (Debian: liblcm-dev, liblcm-bin)");
#endif
}

} // namespace

std::unique_ptr<Link> open_link(const std::string &where, const blw_plant_t &plant,
                                std::uint8_t width)
{
    const std::size_t colon = where.find(':');
    const std::string kind  = where.substr(0U, colon);
    const std::string rest  = (colon == std::string::npos) ? "" : where.substr(colon + 1U);
    if ((kind == "can") || (kind == "canfd")) {
        return std::make_unique<CanLink>(where, rest, kind == "canfd");
    }
    if (kind == "slcan") {
        return std::make_unique<SerialLink>(where, rest);
    }
    if (kind == "lcm") {
        return open_lcm(where, rest, plant, width);
    }
    if (kind == "replay") {
        return std::make_unique<ReplayLink>(where, rest);
    }
    throw InputError(where + ": a link is can:..., canfd:..., slcan:..., lcm:... or replay:...");
}

void wait_for(const std::vector<Link *> &links, int time_ms)
{
    std::vector<pollfd> waiting;
    for (const Link *link : links) {
        if (link->handle() >= 0) {
            waiting.push_back({link->handle(), POLLIN, 0});
        }
    }
    (void)::poll(waiting.data(), static_cast<nfds_t>(waiting.size()), time_ms);
}

void Watch::look()
{
    const char *const now = link_.trouble();
    if (now != told_) {
        std::cerr << "blw_bus: " << where_ << ": " << ((now != nullptr) ? now : "back")
                  << std::endl;
        told_ = now;
    }
}

bool deliver(Link &link, const blw_frame_t &frame)
{
    for (int tries = 0; tries < ROOM_TRIES; tries++) {
        if (blw_port_send(link.port(), &frame)) {
            return true;
        }
        if (link.trouble() != nullptr) {
            return false;
        }
        (void)::poll(nullptr, 0U, ROOM_MS);
    }
    return false;
}

std::uint32_t model_id(const std::string &model_sha256)
{
    const std::string digits = model_sha256.substr(0U, ID_DIGITS);
    if ((digits.size() < ID_DIGITS)
        || (digits.find_first_not_of("0123456789abcdef") != std::string::npos)) {
        throw InputError("the design has no model_sha256, which names the model on a bus");
    }
    return static_cast<std::uint32_t>(std::stoul(digits, nullptr, 16));
}

} // namespace sim
