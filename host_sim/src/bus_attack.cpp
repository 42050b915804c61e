/* SPDX-License-Identifier: MIT */
/* Gateway: what comes from the sensors' side goes on to the node's, and back.  Measurements wait
 * until all of the step are there, since an attack may depend on all; then those that are held are
 * changed, withheld or delayed.  A held sensor in an FD frame, which others share, is withheld by
 * saying that it has no sample.
 *
 * Intruder: on the node's link, after the true measurements of a step, forged ones with the same
 * identifiers and step.  Or, with --fault, frames of a broken neighbour: see FAULTS. */
#include "attack_parse.h"
#include "bus.h"
#include "error.h"
#include "frames.h"
#include "methods.h"
#include "scenario.h"
#include <algorithm>
#include <iostream>
#include <map>

namespace sim
{
namespace
{

const int           BABBLE       = 12;  /* frames at a time */
const double        FORGED       = 1e3; /* far from any sample */
const std::uint64_t ANOTHER_STEP = 300U;
const std::uint64_t FAR_AHEAD    = 100000U;
const char *const   FAULTS[] = {"babble", "crc", "stale", "early", "duplicate", "sync", "garbage"};

class BusAttacker
{
public:
    BusAttacker(const BusOptions &options, const Design &design, const Scenario &scenario)
        : options_(options), design_(design), plant_(load_plant(design)),
          node_side_(open_link(options.link, plant_->tables, 1U)),
          sensor_side_(options.sensor_link.empty()
                           ? nullptr
                           : open_link(options.sensor_link, plant_->tables, 1U)),
          attacker_(design, scenario.attacks,
                    {scenario.steps, static_cast<double>(scenario.steps) * design.dt_s},
                    scenario.seed),
          model_(model_id(design.model_sha256))
    {
        for (const AttackSpec &attack : scenario.attacks) {
            const bool withholds =
                (attack.kind == AttackKind::drop) || (attack.kind == AttackKind::delay);
            if (withholds && !sensor_side_) {
                throw InputError("attack " + attack.id
                                 + ": an intruder cannot withhold samples; a "
                                   "gateway can (--sensor-link)");
            }
        }
        clear();
    }

    void run()
    {
        std::vector<Link *> links   = {node_side_.get()};
        std::vector<Watch>  watches = {{*node_side_, options_.link}};
        std::uint64_t       last_us = blw_port_now_us(node_side_->port());
        if (sensor_side_) {
            links.push_back(sensor_side_.get());
            watches.emplace_back(*sensor_side_, options_.sensor_link);
        }
        while (!ended_ && !bus_interrupted) {
            const bool any = pump();
            std::for_each(watches.begin(), watches.end(), [](Watch &watch) { watch.look(); });
            if (any) {
                last_us = blw_port_now_us(node_side_->port());
            } else {
                wait_for(links, WAIT_MS);
            }
            if ((options_.idle_s > 0U)
                && (blw_port_now_us(node_side_->port()) > (last_us + options_.idle_s * SECOND))) {
                return;
            }
        }
    }

    Json report() const
    {
        return {{"steps", steps_},
                {"forged", forged_},
                {"withheld", withheld_},
                {"forwarded", forwarded_},
                {"link", node_side_->counters()}};
    }

private:
    /* @return whether anything was received. */
    bool pump()
    {
        blw_frame_t frame;
        bool        any = false;
        if (sensor_side_) {
            while (blw_port_recv(sensor_side_->port(), &frame)) {
                any = true;
                from_plant(frame);
            }
        }
        while (blw_port_recv(node_side_->port(), &frame)) {
            any = true;
            from_node_side(frame);
        }
        return any;
    }

    void from_node_side(const blw_frame_t &frame)
    {
        if (!sensor_side_) {
            from_plant(frame);
            return;
        }
        const blw_wire_kind_t kind = blw_wire_kind(&frame);
        if ((kind == BLW_WIRE_ESTIMATE) || (kind == BLW_WIRE_STATUS)
            || (kind == BLW_WIRE_SENSOR_BITS)) {
            forward(*sensor_side_, frame);
        } /* else what we sent ourselves, on a link that hears itself */
    }

    void from_plant(const blw_frame_t &frame)
    {
        const blw_wire_kind_t kind = blw_wire_kind(&frame);
        if (kind == BLW_WIRE_SYNC) {
            take_sync(frame);
        } else if (kind == BLW_WIRE_INPUT) {
            take_values(frame, u_, u_here_);
            forward(*node_side_, frame);
        } else if (kind == BLW_WIRE_MEASUREMENT) {
            take_measurement(frame);
        }
    }

    void take_measurement(const blw_frame_t &frame)
    {
        if (sensor_side_) {
            waiting_.push_back(frame);
        }
        take_values(frame, honest_.y, honest_.valid);
        if (honest_.valid == BLW_MASK_ALL(design_.m)) {
            attack();
        }
    }

    void forward(Link &link, const blw_frame_t &frame)
    {
        if (sensor_side_) {
            forwarded_ += deliver(link, frame) ? 1U : 0U;
        }
    }

    void take_sync(const blw_frame_t &frame)
    {
        blw_wire_sync_t sync;
        if ((blw_wire_get_sync(&frame, &sync) == BLW_WIRE_OK)
            && (sync.model == (model_ & BLW_WIRE_MODEL_BITS))) {
            follow(sync.k);
        }
        forward(*node_side_, frame);
    }

    void follow(std::uint32_t k)
    {
        const bool end = k == BLW_WIRE_K_END;
        if ((k == k_) || (!end && is_ours(k))) {
            return;
        }
        attack(); /* the step before, if samples of it are missing */
        if (end) {
            ended_ = true; /* for good: what we sent ourselves may still come after it */
        } else {
            clear();
            k_ = k;
        }
    }

    /* A link may hear itself, some steps late. */
    bool is_ours(std::uint32_t k) const
    {
        return (own_sync_ > 0U) && ((own_sync_ - k) < FAR_AHEAD / 2U);
    }

    /* The first value of a sensor in a step is the true one; ours comes later. */
    void take_values(const blw_frame_t &frame, Eigen::VectorXd &to, blw_mask_t &here)
    {
        blw_wire_values_t values;
        if ((blw_wire_get_values(&frame, &values) != BLW_WIRE_OK)
            || (values.seq != (k_ & UINT16_MAX))
            || (static_cast<Eigen::Index>(values.first) + values.count > to.size())) {
            return;
        }
        for (std::size_t j = 0U; j < values.count; j++) {
            const std::size_t at  = values.first + j;
            const blw_mask_t  bit = static_cast<blw_mask_t>(1) << (at % BLW_MAX_SENSORS);
            if ((((values.valid >> j) & 1U) != 0U) && ((here & bit) == 0U)) {
                to[static_cast<Eigen::Index>(at)] = static_cast<double>(values.value[j]);
                here |= bit;
            }
        }
    }

    void attack()
    {
        if ((k_ == 0U) || made_) {
            return;
        }
        made_                          = true;
        const Instant         now      = {k_, static_cast<double>(k_) * design_.dt_s};
        const AttackedSamples attacked = attacker_.apply(now, u_, honest_);
        steps_++;
        if (!options_.fault.empty()) {
            disturb();
        } else if (sensor_side_) {
            send_on(attacked);
        } else {
            forge(attacked);
        }
    }

    /* What is not held goes on as it came. */
    void send_on(const AttackedSamples &attacked)
    {
        for (blw_frame_t &frame : waiting_) {
            blw_wire_values_t values;
            if (blw_wire_get_values(&frame, &values) == BLW_WIRE_OK) {
                change(attacked, values, frame);
            }
            if (frame.len > 0U) {
                forward(*node_side_, frame);
            }
        }
    }

    /* Put the attacked values into a frame; an empty one is not sent. */
    void change(const AttackedSamples &attacked, blw_wire_values_t &values, blw_frame_t &frame)
    {
        const bool shared  = frame.len > BLW_FRAME_CLASSIC_MAX;
        bool       changed = false;
        for (std::size_t j = 0U; j < values.count; j++) {
            const std::size_t at  = values.first + j;
            const blw_mask_t  bit = static_cast<blw_mask_t>(1) << at;
            if ((attacked.attacked & bit) == 0U) {
                continue;
            }
            const bool sent = (attacked.samples.valid & bit) != 0U;
            changed         = true;
            values.valid    = static_cast<std::uint16_t>(sent ? (values.valid | (1U << j))
                                                              : (values.valid & ~(1U << j)));
            values.value[j] =
                sent ? static_cast<float>(attacked.samples.y[static_cast<Eigen::Index>(at)]) : 0.0F;
            (sent ? forged_ : withheld_)++;
        }
        if (!changed) {
            return;
        }
        if (!shared && (values.valid == 0U)) {
            frame.len = 0U;
            return;
        }
        (void)blw_wire_put_values(&values, shared ? BLW_WIRE_FD : BLW_WIRE_CLASSIC, &frame);
    }

    void forge(const AttackedSamples &attacked)
    {
        for (std::size_t i = 0U; i < design_.m; i++) {
            if (((attacked.attacked >> i) & 1U) != 0U) {
                send(value_frame(BLW_WIRE_MEASUREMENT, k_, i,
                                 attacked.samples.y[static_cast<Eigen::Index>(i)]));
            }
        }
    }

    void send(const blw_frame_t &frame)
    {
        forged_ += deliver(*node_side_, frame) ? 1U : 0U;
    }

    /* One fault of the kind, with the identifier of sensor 0. */
    void disturb()
    {
        const std::string &fault = options_.fault;
        const double       y     = honest_.y[0];
        blw_frame_t        frame = value_frame(BLW_WIRE_MEASUREMENT, k_, 0U, y);
        if (fault == "crc") {
            frame.data[0] ^= 1U;
        } else if (fault == "stale") {
            frame = value_frame(BLW_WIRE_MEASUREMENT, k_ - ANOTHER_STEP, 0U, FORGED);
        } else if (fault == "early") {
            frame = value_frame(BLW_WIRE_MEASUREMENT, k_ + ANOTHER_STEP, 0U, FORGED);
        } else if (fault == "sync") {
            own_sync_ = static_cast<std::uint32_t>(k_ + FAR_AHEAD);
            frame     = sync_frame(own_sync_, model_);
        } else if (fault == "garbage") {
            frame.len = 5U;
        }
        for (int time = 0; time < ((fault == "babble") ? BABBLE : 1); time++) {
            send(frame);
        }
    }

    void clear()
    {
        honest_ = {Eigen::VectorXd::Zero(static_cast<Eigen::Index>(design_.m)), 0U};
        u_      = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(design_.l));
        u_here_ = 0U;
        made_   = false;
        waiting_.clear();
    }

    const BusOptions        &options_;
    const Design            &design_;
    std::unique_ptr<Plant>   plant_;
    std::unique_ptr<Link>    node_side_;
    std::unique_ptr<Link>    sensor_side_;
    Attacker                 attacker_;
    std::uint32_t            model_;
    Samples                  honest_;
    Eigen::VectorXd          u_;
    blw_mask_t               u_here_ = 0U;
    std::vector<blw_frame_t> waiting_;
    std::uint64_t            k_         = 0U;
    std::uint32_t            own_sync_  = 0U;
    bool                     made_      = false;
    bool                     ended_     = false;
    std::uint64_t            steps_     = 0U;
    std::uint64_t            forged_    = 0U;
    std::uint64_t            withheld_  = 0U;
    std::uint64_t            forwarded_ = 0U;
};

} // namespace

int attack_command(const BusOptions &options)
{
    const auto known = [&](const char *fault) { return options.fault == fault; };
    if (!options.fault.empty() && std::none_of(std::begin(FAULTS), std::end(FAULTS), known)) {
        throw InputError("unknown fault \"" + options.fault
                         + "\"; known are babble, crc, stale, early, duplicate, sync, garbage");
    }
    const Design   design   = load_design(options.run.design);
    const Scenario scenario = load_scenario(options.run.input, design, options.run.seed);
    BusAttacker    attacker(options, design, scenario);
    say_listening("attack", options.link);
    attacker.run();
    std::cout << attacker.report().dump() << "\n";
    return 0;
}

} // namespace sim
