/* SPDX-License-Identifier: MIT */
/** @file shared_link.h  One link for several nodes of a process: a serial line has one reader. */
#ifndef BLW_SIM_SHARED_LINK_H
#define BLW_SIM_SHARED_LINK_H
#include "link.h"
#include <deque>
#include <memory>
#include <vector>

namespace sim
{

class SharedLink
{
public:
    /** @param link outlives this */
    explicit SharedLink(Link &link) : link_(link) {}
    SharedLink(const SharedLink &)            = delete;
    SharedLink &operator=(const SharedLink &) = delete;

    /** A port for one more node, which hears what take() takes from then on; it lives as long as
     *  this.  @param speaks what the node sends is sent; else nobody hears it */
    blw_port_t *join(bool speaks);
    /** One frame, if there is one, from the link to all nodes.  @return whether there was one */
    bool take();

private:
    struct Seat;
    struct Port {
        blw_port_t base;
        Seat      *seat;
    };
    struct Seat {
        Port                    port;
        Link                   *link;
        bool                    speaks;
        std::deque<blw_frame_t> waiting;
    };
    static Seat                &of(blw_port_t *port);
    static std::uint64_t        now_us(blw_port_t *port);
    static bool                 recv(blw_port_t *port, blw_frame_t *frame);
    static bool                 send(blw_port_t *port, const blw_frame_t *frame);
    static const blw_port_ops_t OPS;

    Link                              &link_;
    std::vector<std::unique_ptr<Seat>> seats_;
};

} // namespace sim
#endif
