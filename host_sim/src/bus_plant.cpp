/* SPDX-License-Identifier: MIT */
#include "bus.h"
#include "error.h"
#include "estimate_reader.h"
#include "frames.h"
#include "plant.h"
#include "session.h"
#include "trial.h"
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>

namespace sim
{
namespace
{

const char *const TRUTH = "truth";
const int         ENDS  = 3; /* times that the end is said: nobody confirms it */
/* More inputs than a mask has bits are all valid all the same: an input is never missing. */
const blw_mask_t ALL = ~static_cast<blw_mask_t>(0);

class BusPlant
{
public:
    BusPlant(const BusOptions &options, const Design &design, const Scenario &scenario)
        : options_(options), design_(design), scenario_(scenario), tables_(load_plant(design)),
          link_(open_link(options.link, tables_->tables, 1U)), watch_(*link_, options.link),
          plant_(design, scenario.x0_mean, scenario.x0_covariance, scenario.seed),
          reader_(design.x0), model_(model_id(design.model_sha256))
    {
        if (design.l > BLW_WIRE_MAX_INPUTS) {
            throw InputError(design.path + ": more inputs than a bus has identifiers");
        }
        log_.has_truth = true;
    }

    /* The whole run; what diverged, if it did. */
    std::optional<Divergence> run()
    {
        log_.rows.push_back(empty_row(design_));
        log_.rows.front().x = plant_.x();
        log_.rows.front().u = input(0.0);
        next_us_            = blw_port_now_us(link_->port());
        for (std::uint64_t k = 1U; (k <= scenario_.steps) && !bus_interrupted; k++) {
            plant_.step(log_.rows.back().u);
            const std::optional<Divergence> divergence =
                find_divergence(plant_.x(), scenario_, design_, k);
            if (divergence) {
                return divergence;
            }
            step(k);
        }
        return std::nullopt;
    }

    void end()
    {
        for (int time = 0; time < ENDS; time++) {
            put(sync_frame(BLW_WIRE_K_END, model_));
            wait_for({}, WAIT_MS);
        }
    }

    const Log &log() const
    {
        return log_;
    }

    std::uint64_t answered() const
    {
        return answered_;
    }

    Json report() const
    {
        return {{"steps", log_.rows.size() - 1U},
                {"answered", answered_},
                {"sent", sent_},
                {"unsent", unsent_},
                {"link", link_->counters()}};
    }

private:
    Eigen::VectorXd input(double t_s) const
    {
        const ControllerSpec &controller = scenario_.controller;
        const bool            truth      = !controller.feedback || (controller.method == TRUTH);
        return control(controller, design_, t_s, truth ? plant_.x() : reader_.x_hat());
    }

    void step(std::uint64_t k)
    {
        Row row     = empty_row(design_);
        row.at      = {k, static_cast<double>(k) * design_.dt_s};
        row.x       = plant_.x();
        row.samples = plant_.measure();
        put(sync_frame(static_cast<std::uint32_t>(k), model_));
        put_all(value_frames(BLW_WIRE_INPUT, k, {log_.rows.back().u, ALL}, link_->format()));
        put_all(value_frames(BLW_WIRE_MEASUREMENT, k, row.samples, link_->format()));
        listen(k);
        row.u = input(row.at.t_s);
        log_.rows.push_back(std::move(row));
    }

    void put(const blw_frame_t &frame)
    {
        (deliver(*link_, frame) ? sent_ : unsent_)++;
        watch_.look();
    }

    void put_all(const std::vector<blw_frame_t> &frames)
    {
        for (const blw_frame_t &frame : frames) {
            put(frame);
        }
    }

    /* Until the answer to step k, or until it is time for the next one.  Steps that were missed are
     * not made up for: in a burst they would overrun whoever listens. */
    void listen(std::uint64_t k)
    {
        blw_port_t *const   port     = link_->port();
        const bool          paced    = options_.pace_us > 0U;
        const std::uint64_t patience = 1000U * options_.patience_ms;
        const std::uint64_t now_us   = blw_port_now_us(port);
        blw_frame_t         frame;
        next_us_ = paced ? std::max(next_us_ + options_.pace_us, now_us) : (now_us + patience);
        while ((blw_port_now_us(port) < next_us_) && !bus_interrupted) {
            if (!blw_port_recv(port, &frame)) {
                wait_for({link_.get()}, WAIT_MS);
                watch_.look();
                continue;
            }
            if (reader_.take(frame) && (reader_.status().seq == (k & UINT16_MAX))) {
                answered_++;
                if (!paced) {
                    return;
                }
            }
        }
    }

    const BusOptions      &options_;
    const Design          &design_;
    const Scenario        &scenario_;
    std::unique_ptr<Plant> tables_;
    std::unique_ptr<Link>  link_;
    Watch                  watch_;
    TruePlant              plant_;
    EstimateReader         reader_;
    Log                    log_;
    std::uint32_t          model_;
    std::uint64_t          next_us_  = 0U;
    std::uint64_t          answered_ = 0U;
    std::uint64_t          sent_     = 0U;
    std::uint64_t          unsent_   = 0U;
};

} // namespace

int plant_command(const BusOptions &options)
{
    const Design   design   = load_design(options.run.design);
    const Scenario scenario = load_scenario(options.run.input, design, options.run.seed);
    BusPlant       plant(options, design, scenario);
    say_listening("plant", options.link);

    const std::optional<Divergence> divergence = plant.run();
    OutputSet                       files(options.run.out);
    files.add("log.csv", format_log(plant.log(), design));
    files.add("plant.json", plant.report().dump(2) + "\n");
    files.commit(); /* before the end is said: a node then reads it */
    plant.end();
    if (options.run.json) {
        std::cout << plant.report().dump(2) << "\n";
    }
    if (divergence) {
        std::cerr << "blw_bus: " << divergence_text(options.run.input, *divergence) << "\n";
        return 1;
    }
    if (plant.answered() == 0U) {
        std::cerr << "blw_bus: nobody on " << options.link << " answered; is there a node of model "
                  << design.name << "?\n";
        return 1;
    }
    return 0;
}

} // namespace sim
