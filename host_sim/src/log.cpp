/* SPDX-License-Identifier: MIT */
#include "log.h"
#include "constants.h"
#include "csv.h"
#include "error.h"
#include "text.h"
#include "toml_read.h"
#include <algorithm>
#include <cmath>

namespace sim
{
namespace
{

struct Column {
    std::optional<std::size_t> index; /* nothing: the log has no such column */
    double                     factor = 1.0;
};

struct Layout {
    Column              k, t;
    std::vector<Column> y, u, x, a;
};

/* One column per name, with prefix; all of them must be there if `needed`. */
std::vector<Column> find_columns(const CsvFile &csv, const std::string &path,
                                 const std::string &prefix, const std::vector<std::string> &names,
                                 bool needed)
{
    std::vector<Column> columns;
    for (const std::string &name : names) {
        columns.push_back({csv.find(prefix + name), 1.0});
        if (needed && !columns.back().index) {
            throw InputError(path + ":1:1: column \"" + prefix + name + "\" is missing");
        }
    }
    return columns;
}

std::optional<double> cell(const CsvFile &csv, const Column &column)
{
    if (!column.index) {
        return std::nullopt;
    }
    const std::optional<double> value = csv.number(*column.index);
    if (!value) {
        return std::nullopt;
    }
    if (!std::isfinite(*value * column.factor)) {
        csv.fail(*column.index, "is too large in the unit of the model");
    }
    return *value * column.factor;
}

void read_samples(const CsvFile &csv, const Layout &layout, Row &row)
{
    for (std::size_t i = 0U; i < layout.y.size(); i++) {
        const auto                  at  = static_cast<Eigen::Index>(i);
        const blw_mask_t            bit = static_cast<blw_mask_t>(1) << i;
        const std::optional<double> y   = cell(csv, layout.y[i]);
        const std::optional<double> a   = cell(csv, layout.a[i]);
        row.samples.y[at]               = y.value_or(0.0);
        row.a[at]                       = a.value_or(0.0);
        row.samples.valid |= y ? bit : 0U;
        row.attacked |= ((row.a[at] < 0.0) || (row.a[at] > 0.0)) ? bit : 0U;
    }
    row.active = row.attacked;
}

void read_state(const CsvFile &csv, const Layout &layout, Row &row)
{
    for (std::size_t j = 0U; j < layout.x.size(); j++) {
        row.x[static_cast<Eigen::Index>(j)] = cell(csv, layout.x[j]).value_or(UNKNOWN);
    }
}

/* An input may be empty in the last row only: there it has no effect any more. */
void read_inputs(const CsvFile &csv, const Layout &layout, Row &row, bool &gap)
{
    for (std::size_t j = 0U; j < layout.u.size(); j++) {
        const std::optional<double> u       = cell(csv, layout.u[j]);
        row.u[static_cast<Eigen::Index>(j)] = u.value_or(0.0);
        gap                                 = gap || !u;
    }
}

void check_time(const CsvFile &csv, const Layout &layout, const Row &row, const Log &log)
{
    if (log.rows.empty()) {
        return;
    }
    const Instant &last = log.rows.back().at;
    if (layout.k.index && (row.at.k != last.k + 1U)) {
        csv.fail(*layout.k.index, "k must count up by one, it was " + std::to_string(last.k));
    }
    if (layout.t.index && !(row.at.t_s > last.t_s)) {
        csv.fail(*layout.t.index, "time must increase, it was " + shortest(last.t_s));
    }
}

void read_instant(const CsvFile &csv, const Layout &layout, const Design &design, Row &row,
                  const Log &log)
{
    row.at.k = log.rows.empty() ? 0U : (log.rows.back().at.k + 1U);
    if (layout.k.index) {
        const double k = csv.required(*layout.k.index);
        if (!(k >= 0.0) || (k > 0x1.0p53) || (std::floor(k) < k)) {
            csv.fail(*layout.k.index, "expected an integer, 0 or more");
        }
        row.at.k = static_cast<std::uint64_t>(k);
    }
    row.at.t_s = static_cast<double>(row.at.k) * design.dt_s;
    if (layout.t.index) {
        row.at.t_s = csv.required(*layout.t.index) * layout.t.factor;
    }
    check_time(csv, layout, row, log);
}

Log read_rows(CsvFile &csv, const std::string &path, const Layout &layout, const Design &design)
{
    Log  log;
    bool gap = false;
    while (csv.next()) {
        if (gap) {
            throw InputError(path + ": an input is empty in a row that is not the last, k = "
                             + std::to_string(log.rows.back().at.k));
        }
        Row row = empty_row(design);
        read_instant(csv, layout, design, row, log);
        read_samples(csv, layout, row);
        read_state(csv, layout, row);
        read_inputs(csv, layout, row, gap);
        log.has_truth = log.has_truth || !row.x.array().isNaN().all();
        log.rows.push_back(std::move(row));
    }
    if (log.rows.size() < 2U) {
        throw InputError(path + ": has no measurement, at least two rows are needed");
    }
    return log;
}

std::vector<std::string> known_columns(const Design &design)
{
    std::vector<std::string> names = {"k", "t_s"};
    names.insert(names.end(), design.sensors.begin(), design.sensors.end());
    names.insert(names.end(), design.inputs.begin(), design.inputs.end());
    for (const std::string &state : design.states) {
        names.push_back("x:" + state);
    }
    for (const std::string &sensor : design.sensors) {
        names.push_back("a:" + sensor);
    }
    return names;
}

Column mapped_column(const CsvFile &csv, const std::string &path, const TomlTable &columns,
                     const std::string &name, bool needed)
{
    Column      column;
    std::string source = name;
    if (const toml::node *node = columns.node(name.c_str()); node != nullptr) {
        if (node->is_table()) {
            const TomlTable entry(*node->as_table(), columns.path(), {"column", "unit_factor"});
            source        = entry.text("column").value_or(name);
            column.factor = entry.number("unit_factor").value_or(1.0);
        } else {
            source = *columns.text(name.c_str());
        }
        needed = true;
    }
    column.index = csv.find(source);
    if (needed && !column.index) {
        throw InputError(path + ":1:1: column \"" + source + "\" for " + name + " is missing");
    }
    return column;
}

Layout foreign_layout(const CsvFile &csv, const std::string &path, const TomlTable &map,
                      const Design &design)
{
    static const toml::table       no_columns;
    const toml::table             *table = map.table("columns");
    const TomlTable                columns((table != nullptr) ? *table : no_columns, map.path());
    const std::vector<std::string> known = known_columns(design);
    columns.check_keys(known);
    Layout layout;
    layout.a.resize(design.m);
    for (const std::string &sensor : design.sensors) {
        layout.y.push_back(mapped_column(csv, path, columns, sensor, true));
    }
    for (const std::string &input : design.inputs) {
        layout.u.push_back(mapped_column(csv, path, columns, input, true));
    }
    for (const std::string &state : design.states) {
        layout.x.push_back(mapped_column(csv, path, columns, "x:" + state, false));
    }
    if (const std::optional<std::string> time = map.text("time"); time) {
        layout.t.index = csv.find(*time);
        if (!layout.t.index) {
            throw InputError(path + ":1:1: time column \"" + *time + "\" is missing");
        }
    }
    return layout;
}

/* k = 0 at one step before the first sample, with inputs at rest. */
void put_initial_row(Log &log, const Design &design)
{
    Row initial    = empty_row(design);
    initial.at.t_s = log.rows.front().at.t_s - design.dt_s;
    for (Row &row : log.rows) {
        row.at.k++;
    }
    log.rows.insert(log.rows.begin(), std::move(initial));
}

void check_grid(const Log &log, const std::string &path, const Design &design)
{
    for (std::size_t i = 1U; i < log.rows.size(); i++) {
        const double step = log.rows[i].at.t_s - log.rows[i - 1U].at.t_s;
        if (std::fabs(step - design.dt_s) > 0.5 * design.dt_s) {
            throw InputError(path + ":" + std::to_string(i + 2U) + ":1: time goes on by "
                             + with_digits(step, 4) + " s, the model's dt_s is "
                             + shortest(design.dt_s));
        }
    }
}

void append(std::string &line, std::optional<double> value)
{
    line += value ? ("," + shortest(*value)) : ",";
}

std::string format_row(const Row &row, bool has_truth)
{
    std::string line = std::to_string(row.at.k) + "," + shortest(row.at.t_s);
    for (Eigen::Index i = 0; i < row.samples.y.size(); i++) {
        const bool sent = ((row.samples.valid >> i) & 1U) != 0U;
        append(line, sent ? std::optional<double>(row.samples.y[i]) : std::nullopt);
    }
    for (const double u : row.u) {
        append(line, u);
    }
    for (Eigen::Index j = 0; has_truth && (j < row.x.size()); j++) {
        append(line, std::isnan(row.x[j]) ? std::nullopt : std::optional<double>(row.x[j]));
    }
    for (Eigen::Index i = 0; i < row.a.size(); i++) {
        const bool held = ((row.attacked & row.samples.valid) >> i) & 1U;
        append(line, held ? std::optional<double>(row.a[i]) : std::nullopt);
    }
    return line + "\n";
}

} // namespace

Row empty_row(const Design &design)
{
    const auto n = static_cast<Eigen::Index>(design.n);
    const auto m = static_cast<Eigen::Index>(design.m);
    const auto l = static_cast<Eigen::Index>(design.l);
    Row        row;
    row.samples.y = Eigen::VectorXd::Zero(m);
    row.u         = Eigen::VectorXd::Zero(l);
    row.x         = Eigen::VectorXd::Constant(n, UNKNOWN);
    row.a         = Eigen::VectorXd::Zero(m);
    return row;
}

Log read_log(const std::string &path, const Design &design)
{
    CsvFile                        csv(path);
    const std::vector<std::string> known = known_columns(design);
    for (std::size_t i = 0U; i < csv.header().size(); i++) {
        if (std::find(known.begin(), known.end(), csv.header()[i]) == known.end()) {
            csv.fail(i, "unknown column; a foreign log needs a column map (--map)");
        }
    }
    Layout layout;
    layout.k = {csv.find("k"), 1.0};
    layout.t = {csv.find("t_s"), 1.0};
    find_columns(csv, path, "", {"k", "t_s"}, true);
    layout.y = find_columns(csv, path, "", design.sensors, true);
    layout.u = find_columns(csv, path, "", design.inputs, true);
    layout.x = find_columns(csv, path, "x:", design.states, false);
    layout.a = find_columns(csv, path, "a:", design.sensors, false);
    return read_rows(csv, path, layout, design);
}

Log read_foreign_log(const std::string &path, const std::string &map_path, const Design &design)
{
    const toml::table root = read_toml(map_path);
    const TomlTable   map(root, map_path, {"time", "first_row", "columns"});
    const std::string first = map.text("first_row").value_or("initial");
    if ((first != "initial") && (first != "sample")) {
        map.fail("first_row", "expected \"initial\" or \"sample\"");
    }
    CsvFile csv(path);
    Log     log = read_rows(csv, path, foreign_layout(csv, path, map, design), design);
    check_grid(log, path, design);
    if (first == "sample") {
        put_initial_row(log, design);
    }
    return log;
}

std::string format_log(const Log &log, const Design &design)
{
    std::vector<std::string> names = known_columns(design);
    if (!log.has_truth) {
        const auto first = names.begin() + static_cast<std::ptrdiff_t>(2U + design.m + design.l);
        names.erase(first, first + static_cast<std::ptrdiff_t>(design.n));
    }
    std::string text = join(names, ",") + "\n";
    for (const Row &row : log.rows) {
        text += format_row(row, log.has_truth);
    }
    return text;
}

} // namespace sim
