/* SPDX-License-Identifier: MIT */
#include "blw/blw_station.h"
#include "bus.h"
#include "error.h"
#include "text.h"
#include <iostream>

namespace sim
{
namespace
{

class SensorNode
{
public:
    SensorNode(const BusOptions &options, const Design &design, const Plant &plant,
               const std::string &method)
        : estimator_(design, plant, method), model_(split_model(estimator_)),
          link_(open_link(options.link, plant.tables, model_.jordan->r)),
          watch_(*link_, options.link), sensor_(design.sensor_index(options.sensor, "--sensor")),
          filter_memory_(BLW_LOCAL_MEM(design.n, model_.jordan->r)),
          memory_(BLW_STATION_MEM(design.n, design.l))
    {
        const bool ready =
            (blw_local_init(&filter_, &model_, static_cast<std::uint8_t>(sensor_),
                            filter_memory_.data(), filter_memory_.size())
             == BLW_OK)
            && (blw_station_init(&station_, model_id(design.model_sha256), link_->format(),
                                 &filter_, link_->port(), memory_.data(), memory_.size())
                == BLW_OK);
        if (!ready) {
            throw InputError(design.path + ": method " + method + " does not fit on the bus");
        }
    }

    void run(std::uint64_t idle_s)
    {
        std::uint64_t last_us = blw_port_now_us(link_->port());
        blw_frame_t   frame;
        while (!ended_ && !bus_interrupted) {
            const bool received = blw_port_recv(link_->port(), &frame);
            watch_.look();
            if (received) {
                last_us = frame.t_us;
                take(frame);
                continue;
            }
            wait_for({link_.get()}, WAIT_MS);
            if ((idle_s > 0U) && (blw_port_now_us(link_->port()) > (last_us + (idle_s * SECOND)))) {
                return;
            }
        }
    }

    Json report() const
    {
        const blw_station_counters_t &c = station_.counters;
        return {
            {"steps", c.steps},       {"no_sample", c.no_sample},     {"no_input", c.no_input},
            {"restarts", c.restarts}, {"bad_frame", c.bad_frame},     {"conflict", c.conflict},
            {"unsent", c.unsent},     {"wrong_model", c.wrong_model}, {"link", link_->counters()}};
    }

private:
    void take(const blw_frame_t &frame)
    {
        blw_wire_sync_t sync;
        if (blw_wire_kind(&frame) == BLW_WIRE_MEASUREMENT) {
            sample(frame);
        }
        (void)blw_station_take(&station_, &frame);
        ended_ = (blw_wire_get_sync(&frame, &sync) == BLW_WIRE_OK) && (sync.k == BLW_WIRE_K_END);
    }

    /* The plant's frame stands for the sensor's converter. */
    void sample(const blw_frame_t &frame)
    {
        blw_wire_values_t values;
        if ((blw_wire_get_values(&frame, &values) != BLW_WIRE_OK) || (sensor_ < values.first)
            || (sensor_ >= static_cast<std::size_t>(values.first) + values.count)) {
            return;
        }
        const std::size_t j = sensor_ - values.first;
        blw_station_sample(&station_, values.seq, static_cast<blw_real_t>(values.value[j]),
                           ((values.valid >> j) & 1U) != 0U);
    }

    Estimator                estimator_; /* only its tables */
    const blw_lasso_model_t &model_;
    std::unique_ptr<Link>    link_;
    Watch                    watch_;
    std::size_t              sensor_;
    std::vector<blw_real_t>  filter_memory_, memory_;
    blw_local_t              filter_{};
    blw_station_t            station_{};
    bool                     ended_ = false;
};

} // namespace

int station_command(const BusOptions &options)
{
    if (options.run.methods.size() != 1U) {
        throw InputError("--sensor needs one --method");
    }
    const Design                 design = load_design(options.run.design);
    const std::unique_ptr<Plant> plant  = load_plant(design);
    SensorNode                   node(options, design, *plant, options.run.methods.front());
    say_listening("node", options.link);
    node.run(options.idle_s);

    OutputSet files(options.run.out);
    files.add(options.sensor + ".json", node.report().dump(2) + "\n");
    files.commit();
    if (options.run.json) {
        std::cout << node.report().dump(2) << "\n";
    }
    return 0;
}

} // namespace sim
