/* SPDX-License-Identifier: MIT */
#include "blw/blw_node.h"
#include "bus.h"
#include "error.h"
#include "session.h"
#include "trial.h"
#include "words.h"
#include <algorithm>
#include <cstdio>
#include <iostream>

namespace sim
{
namespace
{

const int           WAIT_MS  = 1;
const std::uint64_t SECOND   = 1000000U;
const std::uint8_t  BABBLING = 8U;
const int           NO_RUN   = 1;

/* A node that nobody hears. */
class Mute
{
public:
    explicit Mute(blw_port_t *inner) : inner_(inner)
    {
        port_.self     = this;
        port_.base.ops = &OPS;
    }
    blw_port_t *port()
    {
        return &port_.base;
    }

private:
    struct Port {
        blw_port_t base;
        Mute      *self;
    };
    static Mute *of(blw_port_t *port)
    {
        return reinterpret_cast<Port *>(port)->self;
    }
    static std::uint64_t now_us(blw_port_t *port)
    {
        return blw_port_now_us(of(port)->inner_);
    }
    static bool recv(blw_port_t *port, blw_frame_t *frame)
    {
        return blw_port_recv(of(port)->inner_, frame);
    }
    static bool send(blw_port_t * /*port*/, const blw_frame_t * /*frame*/)
    {
        return true;
    }
    static const blw_port_ops_t OPS;

    blw_port_t *inner_;
    Port        port_{};
};

const blw_port_ops_t Mute::OPS = {Mute::now_us, Mute::recv, Mute::send};

/* One method on the bus, and what it said. */
class MethodNode
{
public:
    MethodNode(const BusOptions &options, const Design &design, const Plant &plant,
               const std::string &method, bool speaks)
        : design_(design),
          estimator_(design, plant, method, options.fusion ? &blw_lasso_fusion_ops : nullptr),
          width_(options.fusion ? split_model(estimator_).jordan->r : std::uint8_t{1}),
          link_(open_link(options.link, plant.tables, width_)),
          mute_(link_->port()), trace_{method, {}, estimator_.extra_columns()},
          memory_(BLW_NODE_MEM(design.m, width_, design.l))
    {
        config_.model          = model_id(design.model_sha256);
        config_.period_us      = options.period_us;
        config_.deadline_us    = options.deadline_us;
        config_.settle_us      = options.settle_us;
        config_.quarantine     = options.quarantine;
        config_.max_gap        = options.max_gap;
        config_.babbling       = BABBLING;
        config_.collects       = options.fusion ? BLW_WIRE_ZETA : BLW_WIRE_MEASUREMENT;
        config_.width          = width_;
        config_.format         = static_cast<std::uint8_t>(link_->format());
        blw_port_t *const port = speaks ? link_->port() : mute_.port();
        if (blw_node_init(&node_, &config_, &plant.tables, estimator_.handle(), port,
                          memory_.data(), memory_.size())
            != BLW_OK) {
            throw InputError("--deadline-us has to be above 0, and the model to fit on the bus");
        }
        link_->describe(method, node_.report);
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
    Link &link()
    {
        return *link_;
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
                {"link", link_->counters()}};
    }

private:
    const Design           &design_;
    Estimator               estimator_;
    std::uint8_t            width_;
    std::unique_ptr<Link>   link_;
    Mute                    mute_;
    Trace                   trace_;
    blw_node_config_t       config_{};
    std::vector<blw_real_t> memory_;
    blw_node_t              node_{};
};

using Nodes = std::vector<std::unique_ptr<MethodNode>>;

/* The speaker last: its answer lets the plant go on, and then the others have made the step too. */
Nodes make_nodes(const BusOptions &options, const Design &design, const Plant &plant,
                 const std::vector<std::string> &methods)
{
    const std::string speaker = options.speaker.empty() ? methods.back() : options.speaker;
    if (std::find(methods.begin(), methods.end(), speaker) == methods.end()) {
        throw InputError("the speaker " + speaker + " is not among the methods");
    }
    Nodes nodes;
    for (const std::string &method : methods) {
        const bool speaks = (method == speaker) && !options.mute;
        nodes.push_back(std::make_unique<MethodNode>(options, design, plant, method, speaks));
    }
    std::stable_partition(nodes.begin(), nodes.end(),
                          [&](const auto &node) { return node->trace().method != speaker; });
    return nodes;
}

bool all_done(const Nodes &nodes)
{
    return std::all_of(nodes.begin(), nodes.end(), [](const auto &node) { return node->done(); });
}

/* Until the plant says that it is over, nothing has come for too long, or a signal. */
void listen(const Nodes &nodes, std::uint64_t idle_s)
{
    std::vector<Link *> links;
    for (const auto &node : nodes) {
        links.push_back(&node->link());
    }
    blw_port_t *const port    = links.front()->port();
    std::uint64_t     last_us = blw_port_now_us(port);
    while (!all_done(nodes) && !bus_interrupted) {
        const bool over = links.front()->ended(); /* looked at before the last frames are taken */
        for (const auto &node : nodes) {
            if (node->advance()) {
                last_us = blw_port_now_us(port);
            }
        }
        const bool silent = blw_port_now_us(port) > (last_us + (idle_s * SECOND));
        if (over || ((idle_s > 0U) && silent)) {
            return;
        }
        if (links.front()->handle() >= 0) {
            wait_for(links, WAIT_MS);
        } else if (links.front()->down()) {
            wait_for({}, WAIT_MS);
        }
    }
}

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
    Scenario scenario = load_scenario(options.run.input, design);
    scenario.seed     = options.run.seed.value_or(scenario.seed);
    Log log           = read_log(options.log, design);
    attack_log(log, design, scenario.attacks, scenario.seed);
    Bench oracle(design, {}, false);
    replay(log, oracle);
    std::vector<Trace> traces;
    for (const std::string &method : methods) {
        const auto node = std::find_if(nodes.begin(), nodes.end(), [&](const auto &each) {
            return each->trace().method == method;
        });
        traces.push_back(match((*node)->trace(), log));
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
    const Nodes nodes = make_nodes(options, design, *plant, methods);
    say_listening("node", options.link);
    listen(nodes, options.idle_s);

    Json report = Json::object();
    for (const auto &node : nodes) {
        report[node->trace().method] = node->report();
    }
    if (nodes.back()->trace().verdicts.empty()) {
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
    for (const auto &node : nodes) {
        files.add(node->trace().method + ".csv",
                  format_trace(node->trace(), design, estimate_digits()));
    }
    files.commit();
    if (options.run.json) {
        std::cout << report.dump(2) << "\n";
    }
    return 0;
}

} // namespace sim
