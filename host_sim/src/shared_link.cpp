/* SPDX-License-Identifier: MIT */
#include "shared_link.h"

namespace sim
{

const blw_port_ops_t SharedLink::OPS = {now_us, recv, send};

blw_port_t *SharedLink::join(bool speaks)
{
    seats_.push_back(std::make_unique<Seat>());
    Seat &seat  = *seats_.back();
    seat.port   = {{&OPS}, &seat};
    seat.link   = &link_;
    seat.speaks = speaks;
    return &seat.port.base;
}

bool SharedLink::take()
{
    blw_frame_t frame;
    if (!blw_port_recv(link_.port(), &frame)) {
        return false;
    }
    for (const auto &seat : seats_) {
        seat->waiting.push_back(frame);
    }
    return true;
}

SharedLink::Seat &SharedLink::of(blw_port_t *port)
{
    return *reinterpret_cast<Port *>(port)->seat;
}

/* A replayed log is at the time of its next frame already: for a node, those that wait come first.
 */
std::uint64_t SharedLink::now_us(blw_port_t *port)
{
    const Seat &seat = of(port);
    return seat.waiting.empty() ? blw_port_now_us(seat.link->port()) : seat.waiting.front().t_us;
}

bool SharedLink::recv(blw_port_t *port, blw_frame_t *frame)
{
    Seat &seat = of(port);
    if (seat.waiting.empty()) {
        return false;
    }
    *frame = seat.waiting.front();
    seat.waiting.pop_front();
    return true;
}

bool SharedLink::send(blw_port_t *port, const blw_frame_t *frame)
{
    const Seat &seat = of(port);
    return !seat.speaks || blw_port_send(seat.link->port(), frame);
}

} // namespace sim
