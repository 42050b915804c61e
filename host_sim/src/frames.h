/* SPDX-License-Identifier: MIT */
/** @file frames.h  Vectors of values as frames. */
#ifndef BLW_SIM_FRAMES_H
#define BLW_SIM_FRAMES_H
#include "attack.h"
#include "blw/blw_wire.h"
#include <vector>

namespace sim
{

blw_frame_t sync_frame(std::uint32_t k, std::uint32_t model);
/** y or u of step seq.  A value that is not valid is sent as "no sample". */
std::vector<blw_frame_t> value_frames(blw_wire_kind_t kind, std::uint64_t k, const Samples &values,
                                      blw_wire_format_t format);
/** One value alone. */
blw_frame_t value_frame(blw_wire_kind_t kind, std::uint64_t k, std::size_t i, double value);

} // namespace sim
#endif
