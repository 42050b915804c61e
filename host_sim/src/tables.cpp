/* SPDX-License-Identifier: MIT */
#include "tables.h"
#include <cmath>

namespace sim
{

blw_real_t narrow(double value)
{
    const double max = static_cast<double>(BLW_REAL_MAX);
    if (std::fabs(value) > max) {
        return std::copysign(std::numeric_limits<blw_real_t>::infinity(),
                             (value < 0.0) ? BLW_R(-1.0) : BLW_R(1.0));
    }
    return static_cast<blw_real_t>(value);
}

const blw_real_t *TableStore::keep(std::vector<blw_real_t> table)
{
    reals_.push_back(std::move(table));
    return reals_.back().data();
}

const std::uint16_t *TableStore::keep(std::vector<std::uint16_t> table)
{
    indices_.push_back(std::move(table));
    return indices_.back().data();
}

const blw_real_t *TableReader::reals(const char *name, std::size_t length)
{
    if (length == 0U) {
        return nullptr;
    }
    const JsonNode          node   = node_.member(name);
    const Eigen::VectorXd   values = node.vector(length);
    std::vector<blw_real_t> table;
    table.reserve(length);
    for (const double value : values) {
        table.push_back(narrow(value));
        if (!std::isfinite(table.back())) {
            node.fail("a number does not fit this build's number type");
        }
    }
    blw_table_add(walk_, table.data(), length);
    return store_->keep(std::move(table));
}

const blw_real_t *TableReader::reals_or_null(const char *name, std::size_t length)
{
    return node_.has(name) ? reals(name, length) : nullptr;
}

blw_real_t TableReader::real(const char *name)
{
    const blw_real_t value = narrow(node_.member(name).number());
    blw_table_add_real(walk_, value);
    return value;
}

const std::uint16_t *TableReader::indices(const char *name, std::size_t length)
{
    const JsonNode node = node_.member(name);
    if (!node.value().is_array() || (node.value().size() != length)) {
        node.fail("expected a list of " + std::to_string(length) + " integers");
    }
    std::vector<std::uint16_t> table;
    for (const Json &item : node.value()) {
        const JsonNode entry(item, node.where());
        table.push_back(static_cast<std::uint16_t>(entry.integer(UINT16_MAX)));
    }
    return store_->keep(std::move(table));
}

TableReader TableReader::nested(const char *name) const
{
    return TableReader(node_.member(name), *store_, *walk_);
}

} // namespace sim
