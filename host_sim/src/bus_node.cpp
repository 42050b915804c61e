/* SPDX-License-Identifier: MIT */
#include "blw/blw_node.h"
#include "bus.h"
#include "error.h"
#include "session.h"
#include "shared_link.h"
#include "trial.h"
#include "words.h"
#include <algorithm>
#include <cstdio>
#include <iostream>

namespace sim
{
namespace
{

const std::uint8_t BABBLING = 8U;
const int          NO_RUN   = 1;

const blw_estimator_ops_t *ops_of(const BusOptions &options)
{
    return options.fusion ? &blw_lasso_fusion_ops : nullptr;
}

/* Local states per sensor where they are what is collected, else 1. */
std::uint8_t width_of(const BusOptions &options, const Design &design, const Plant &plant,
                      const std::string &method)
{
    return options.fusion ? split_model(Estimator(design, plant, method, ops_of(options))).jordan->r
                          : std::uint8_t{1};
}

/* One method on the bus, and what it said. */
class MethodNode
{
public:
    MethodNode(const BusOptions &options, const Design &design, const Plant &plant,
               const std::string &method, std::uint8_t width, Link &link, blw_port_t *port)
        : design_(design), estimator_(design, plant, method, ops_of(options)),
          link_(link), trace_{method, {}, estimator_.extra_columns()},
          memory_(BLW_NODE_MEM(design.m, width, design.l))
    {
        config_.model       = model_id(design.model_sha256);
        config_.period_us   = options.period_us;
        config_.deadline_us = options.deadline_us;
        config_.settle_us   = options.settle_us;
        config_.quarantine  = options.quarantine;
        config_.max_gap     = options.max_gap;
        config_.babbling    = BABBLING;
        config_.collects    = options.fusion ? BLW_WIRE_ZETA : BLW_WIRE_MEASUREMENT;
        config_.width       = width;
        config_.format      = static_cast<std::uint8_t>(link.format());
        if (blw_node_init(&node_, &config_, &plant.tables, estimator_.handle(), port,
                          memory_.data(), memory_.size())
            != BLW_OK) {
            throw InputError("--deadline-us has to be above 0, and the model to fit on the bus");
        }
    }

    /* This node's reports are what the link tells. */
    void speak()
    {
        link_.describe(trace_.method, node_.report);
    }

    /* Make the steps that are due.  @return whether there were any. */
    bool advance()
    {
        bool made = false;
        while (const blw_node_report_t *report = blw_node_poll(&node_)) {
            const Instant at = {report->k, static_cast<double>(report->k) * design_.dt_s};
            trace_.verdicts.push_back(verdict_of(report->out, at, design_));
            trace_.verdicts.back().extra = estimator_.extra_values();
            made                         = true;
        }
        return made;
    }

    bool done() const
    {
        return blw_node_done(&node_);
    }
    const Trace &trace() const
    {
        return trace_;
    }

    Json report() const
    {
        const blw_node_counters_t &c = node_.counters;
        return {{"steps", c.steps},
                {"blind", c.blind},
                {"taken", c.taken},
                {"lost", c.lost},
                {"bad_crc", c.bad_crc},
                {"bad_layout", c.bad_layout},
                {"bad_value", c.bad_value},
                {"stale", c.stale},
                {"out_of_order", c.out_of_order},
                {"duplicate", c.duplicate},
                {"conflict", c.conflict},
                {"babbling", c.babbling},
                {"bad_sync", c.bad_sync},
                {"wrong_model", c.wrong_model},
                {"no_sync", c.no_sync},
                {"restarts", c.restarts},
                {"unsent", c.unsent},
                {"link", link_.counters()}};
    }

private:
    const Design           &design_;
    Estimator               estimator_;
    Link                   &link_;
    Trace                   trace_;
    blw_node_config_t       config_{};
    std::vector<blw_real_t> memory_;
    blw_node_t              node_{};
};

/* All methods on one link.  The speaker comes last: its answer lets the plant go on, and then the
 * others have made the step too. */
class Nodes
{
public:
    Nodes(const BusOptions &options, const Design &design, const Plant &plant,
          std::vector<std::string> methods)
        : width_(width_of(options, design, plant, methods.front())),
          link_(open_link(options.link, plant.tables, width_)), shared_(*link_),
          watch_(*link_, options.link)
    {
        const std::string speaker = options.speaker.empty() ? methods.back() : options.speaker;
        const auto        place   = std::find(methods.begin(), methods.end(), speaker);
        if (place == methods.end()) {
            throw InputError("the speaker " + speaker + " is not among the methods");
        }
        std::rotate(place, place + 1, methods.end());
        for (const std::string &method : methods) {
            const bool speaks = (method == speaker) && !options.mute;
            nodes_.push_back(std::make_unique<MethodNode>(options, design, plant, method, width_,
                                                          *link_, shared_.join(speaks)));
        }
        if (!options.mute) {
            nodes_.back()->speak();
        }
    }

    /* Until the plant says that it is over, nothing has come for too long, or a signal. */
    void listen(std::uint64_t idle_s)
    {
        std::uint64_t last_us = blw_port_now_us(link_->port());
        while (!done() && !bus_interrupted) {
            const bool over  = link_->ended(); /* looked at before the last frame is taken */
            const bool taken = shared_.take();
            watch_.look();
            if (advance()) {
                last_us = blw_port_now_us(link_->port());
            }
            if (over) {
                return;
            }
            if (!taken) { /* the clock is looked at when there is time */
                const std::uint64_t silence_us = blw_port_now_us(link_->port()) - last_us;
                if ((idle_s > 0U) && (silence_us > (idle_s * SECOND))) {
                    return;
                }
                wait_for({link_.get()}, WAIT_MS);
            }
        }
    }

    bool heard_a_run() const
    {
        return !nodes_.back()->trace().verdicts.empty();
    }

    const Trace &trace(const std::string &method) const
    {
        const auto node = std::find_if(nodes_.begin(), nodes_.end(), [&](const auto &each) {
            return each->trace().method == method;
        });
        return (*node)->trace();
    }

    Json report() const
    {
        Json report = Json::object();
        for (const auto &node : nodes_) {
            report[node->trace().method] = node->report();
        }
        return report;
    }

private:
    bool done() const
    {
        return std::all_of(nodes_.begin(), nodes_.end(),
                           [](const auto &node) { return node->done(); });
    }

    bool advance()
    {
        bool made = false;
        for (const auto &node : nodes_) {
            made = node->advance() || made;
        }
        return made;
    }

    std::uint8_t                             width_;
    std::unique_ptr<Link>                    link_;
    SharedLink                               shared_;
    Watch                                    watch_;
    std::vector<std::unique_ptr<MethodNode>> nodes_;
};

/* The verdicts of exactly the rows of the log; InputError where one is missing. */
Trace match(const Trace &trace, const Log &log)
{
    Trace matched = {trace.method, {}, trace.extra_columns};
    auto  next    = trace.verdicts.begin();
    for (std::size_t i = 1U; i < log.rows.size(); i++) {
        const std::uint64_t k = log.rows[i].at.k;
        next                  = std::find_if(next, trace.verdicts.end(),
                                             [&](const Verdict &verdict) { return verdict.at.k == k; });
        if (next == trace.verdicts.end()) {
            throw InputError("the node of " + trace.method + " made no step k = "
                             + std::to_string(k) + ", so the run cannot be scored");
        }
        matched.verdicts.push_back(*next);
    }
    return matched;
}

/* summary.json and the rest, as `run` writes them; the attacks are those of the scenario. */
void score_run(const BusOptions &options, const Design &design, const Nodes &nodes,
               const std::vector<std::string> &methods, Session &session)
{
    const Scenario scenario = load_scenario(options.run.input, design, options.run.seed);
    Log            log      = read_log(options.log, design);
    attack_log(log, design, scenario.attacks, scenario.seed);
    Bench oracle(design, {}, false);
    replay(log, oracle);
    std::vector<Trace> traces;
    for (const std::string &method : methods) {
        traces.push_back(match(nodes.trace(method), log));
    }
    traces.push_back(oracle.traces().back());
    session.take(log, traces);
    Json head          = summary_head("run", options.run, design, scenario.attacks);
    head["seed"]       = scenario.seed;
    head["runs"]       = 1;
    head["steps"]      = scenario.steps;
    head["divergence"] = Json();
    head["bus"]        = options.link;
    print_summary(session.finish(std::move(head)), options.run.json);
}

} // namespace

const blw_lasso_model_t &split_model(const Estimator &estimator)
{
    if ((estimator.model().method != BLW_METHOD_LASSO)
        && (estimator.model().method != BLW_METHOD_CANONICAL)) {
        throw InputError("method " + estimator.name()
                         + " cannot be split between sensors and a fusion node; lasso and "
                           "canonical can");
    }
    return reinterpret_cast<const blw_lasso_model_t &>(estimator.model());
}

int node_command(const BusOptions &options)
{
    if (!options.sensor.empty()) {
        return station_command(options);
    }
    const Design                   design = load_design(options.run.design);
    const std::unique_ptr<Plant>   plant  = load_plant(design);
    const std::vector<std::string> methods =
        options.fusion ? options.run.methods : choose_methods(options.run, design, options.speaker);
    Nodes nodes(options, design, *plant, methods);
    say_listening("node", options.link);
    nodes.listen(options.idle_s);

    const Json report = nodes.report();
    if (!nodes.heard_a_run()) {
        std::cerr << "blw_bus: no plant of model " << design.name << " was heard on "
                  << options.link << "\n";
        return NO_RUN;
    }
    if (!options.log.empty()) {
        Session session(design, options.run);
        session.add("node.json", report.dump(2) + "\n");
        score_run(options, design, nodes, methods, session);
        return 0;
    }
    OutputSet files(options.run.out);
    files.add("node.json", report.dump(2) + "\n");
    for (const std::string &method : methods) {
        files.add(method + ".csv", format_trace(nodes.trace(method), design, estimate_digits()));
    }
    files.commit();
    if (options.run.json) {
        std::cout << report.dump(2) << "\n";
    }
    return 0;
}

} // namespace sim
