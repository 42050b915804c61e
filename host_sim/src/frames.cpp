/* SPDX-License-Identifier: MIT */
#include "frames.h"
#include "tables.h"
#include <algorithm>

namespace sim
{
namespace
{

/* As the estimator takes it in one process. */
float to_wire(double value)
{
    return static_cast<float>(narrow(value));
}

blw_wire_values_t head(blw_wire_kind_t kind, std::uint64_t k, std::size_t first, std::size_t count)
{
    blw_wire_values_t values{};
    values.kind  = static_cast<std::uint8_t>(kind);
    values.first = static_cast<std::uint8_t>(first);
    values.count = static_cast<std::uint8_t>(count);
    values.seq   = static_cast<std::uint16_t>(k & UINT16_MAX);
    return values;
}

} // namespace

blw_frame_t sync_frame(std::uint32_t k, std::uint32_t model)
{
    const blw_wire_sync_t sync = {k, model};
    blw_frame_t           frame{};
    blw_wire_put_sync(&sync, &frame);
    return frame;
}

std::vector<blw_frame_t> value_frames(blw_wire_kind_t kind, std::uint64_t k, const Samples &samples,
                                      blw_wire_format_t format)
{
    const auto               len  = static_cast<std::size_t>(samples.y.size());
    const std::size_t        span = blw_wire_span(kind, format);
    std::vector<blw_frame_t> frames;
    for (std::size_t first = 0U; first < len; first += span) {
        blw_wire_values_t values = head(kind, k, first, std::min(span, len - first));
        for (std::size_t j = 0U; j < values.count; j++) {
            const bool sent = ((samples.valid >> (first + j)) & 1U) != 0U;
            values.value[j] =
                sent ? to_wire(samples.y[static_cast<Eigen::Index>(first + j)]) : 0.0F;
            values.valid = static_cast<std::uint16_t>(values.valid | (sent ? (1U << j) : 0U));
        }
        frames.emplace_back();
        (void)blw_wire_put_values(&values, format, &frames.back());
    }
    return frames;
}

blw_frame_t value_frame(blw_wire_kind_t kind, std::uint64_t k, std::size_t i, double value)
{
    blw_wire_values_t values = head(kind, k, i, 1U);
    blw_frame_t       frame{};
    values.valid    = 1U;
    values.value[0] = to_wire(value);
    (void)blw_wire_put_values(&values, BLW_WIRE_CLASSIC, &frame);
    return frame;
}

} // namespace sim
