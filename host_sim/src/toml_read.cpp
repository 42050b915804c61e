/* SPDX-License-Identifier: MIT */
#include "toml_read.h"
#include "error.h"
#include "text.h"
#include <algorithm>
#include <cmath>

namespace sim
{
namespace
{

std::string position(const std::string &path, const toml::source_region &source)
{
    return path + ":" + std::to_string(source.begin.line) + ":"
           + std::to_string(source.begin.column);
}

} // namespace

toml::table read_toml(const std::string &path)
{
    const std::string text = read_file(path);
    try {
        return toml::parse(text);
    } catch (const toml::parse_error &error) {
        throw InputError(position(path, error.source()) + ": " + std::string(error.description()));
    }
}

TomlTable::TomlTable(const toml::table &table, std::string path)
    : table_(&table), path_(std::move(path))
{
}

TomlTable::TomlTable(const toml::table &table, std::string path,
                     std::initializer_list<const char *> known)
    : TomlTable(table, std::move(path))
{
    check_keys(std::vector<std::string>(known.begin(), known.end()));
}

void TomlTable::check_keys(const std::vector<std::string> &known) const
{
    for (const auto &[key, value] : *table_) {
        const std::string name(key.str());
        if (std::find(known.begin(), known.end(), name) == known.end()) {
            throw InputError(position(path_, key.source()) + ": unknown key \"" + name
                             + "\"; known are " + join(known, ", "));
        }
    }
}

std::string TomlTable::where(const char *key) const
{
    const toml::node *found = node(key);
    return position(path_, (found != nullptr) ? found->source() : table_->source());
}

void TomlTable::fail(const char *key, const std::string &message) const
{
    throw InputError(where(key) + ": " + key + ": " + message);
}

std::optional<double> TomlTable::number(const char *key) const
{
    if (!has(key)) {
        return std::nullopt;
    }
    const std::optional<double> value =
        node(key)->is_number() ? node(key)->value<double>() : std::nullopt;
    if (!value || !std::isfinite(*value)) {
        fail(key, "expected a finite number");
    }
    return value;
}

std::optional<std::uint64_t> TomlTable::integer(const char *key) const
{
    if (!has(key)) {
        return std::nullopt;
    }
    const std::optional<std::int64_t> value =
        node(key)->is_integer() ? node(key)->value<std::int64_t>() : std::nullopt;
    if (!value || (*value < 0)) {
        fail(key, "expected an integer, 0 or more");
    }
    return static_cast<std::uint64_t>(*value);
}

std::optional<std::string> TomlTable::text(const char *key) const
{
    if (!has(key)) {
        return std::nullopt;
    }
    if (!node(key)->is_string()) {
        fail(key, "expected a text");
    }
    return node(key)->value<std::string>();
}

std::optional<std::vector<double>> TomlTable::numbers(const char *key) const
{
    if (!has(key)) {
        return std::nullopt;
    }
    if (!node(key)->is_array()) {
        return std::vector<double>{*number(key)};
    }
    std::vector<double> list;
    for (const toml::node &item : *node(key)->as_array()) {
        const std::optional<double> value = item.is_number() ? item.value<double>() : std::nullopt;
        if (!value || !std::isfinite(*value)) {
            fail(key, "expected finite numbers");
        }
        list.push_back(*value);
    }
    return list;
}

std::optional<std::vector<std::string>> TomlTable::texts(const char *key) const
{
    if (!has(key)) {
        return std::nullopt;
    }
    if (!node(key)->is_array()) {
        fail(key, "expected a list of texts");
    }
    std::vector<std::string> list;
    for (const toml::node &item : *node(key)->as_array()) {
        if (!item.is_string()) {
            fail(key, "expected texts");
        }
        list.push_back(*item.value<std::string>());
    }
    return list;
}

Eigen::MatrixXd TomlTable::matrix(const char *key, std::size_t rows, std::size_t cols) const
{
    const std::string  shape = std::to_string(rows) + " x " + std::to_string(cols);
    const toml::array *list  = has(key) ? node(key)->as_array() : nullptr;
    if ((list == nullptr) || (list->size() != rows)) {
        fail(key, "expected a " + shape + " matrix");
    }
    Eigen::MatrixXd matrix(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(cols));
    for (std::size_t i = 0U; i < rows; i++) {
        const toml::array *row = (*list)[i].as_array();
        for (std::size_t j = 0U; j < cols; j++) {
            const bool sound = (row != nullptr) && (row->size() == cols) && (*row)[j].is_number()
                               && std::isfinite(*(*row)[j].value<double>());
            if (!sound) {
                fail(key, "expected a " + shape + " matrix of finite numbers");
            }
            matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
                *(*row)[j].value<double>();
        }
    }
    return matrix;
}

const toml::table *TomlTable::table(const char *key) const
{
    if (!has(key)) {
        return nullptr;
    }
    if (!node(key)->is_table()) {
        fail(key, "expected a table");
    }
    return node(key)->as_table();
}

std::vector<const toml::table *> TomlTable::tables(const char *key) const
{
    std::vector<const toml::table *> list;
    if (!has(key)) {
        return list;
    }
    const toml::array *items = node(key)->as_array();
    if ((items == nullptr) || !items->is_array_of_tables()) {
        fail(key, std::string("expected tables, [[") + key + "]]");
    }
    for (const toml::node &item : *items) {
        list.push_back(item.as_table());
    }
    return list;
}

} // namespace sim
