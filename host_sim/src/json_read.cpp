/* SPDX-License-Identifier: MIT */
#include "json_read.h"
#include "error.h"
#include "text.h"
#include <algorithm>
#include <cmath>

namespace sim
{

bool JsonNode::has(const char *name) const
{
    const auto found = value_->find(name);
    return (found != value_->end()) && !found->is_null();
}

JsonNode JsonNode::member(const char *name) const
{
    if (!value_->is_object()) {
        fail("expected an object");
    }
    const auto        found = value_->find(name);
    const bool        top   = where_.find(": ") == std::string::npos;
    const std::string where = where_ + (top ? ": " : ".") + name;
    if (found == value_->end()) {
        throw InputError(where + ": missing");
    }
    return JsonNode(*found, where);
}

std::string JsonNode::text() const
{
    if (!value_->is_string()) {
        fail("expected a text");
    }
    return value_->get<std::string>();
}

std::vector<std::string> JsonNode::texts() const
{
    if (!value_->is_array()) {
        fail("expected a list of texts");
    }
    std::vector<std::string> list;
    for (const Json &item : *value_) {
        list.push_back(JsonNode(item, where_).text());
    }
    return list;
}

double JsonNode::number() const
{
    if (!value_->is_number() || !std::isfinite(value_->get<double>())) {
        fail("expected a finite number");
    }
    return value_->get<double>();
}

std::uint64_t JsonNode::integer(std::uint64_t max) const
{
    if (!value_->is_number_unsigned() || (value_->get<std::uint64_t>() > max)) {
        fail("expected an integer from 0 to " + std::to_string(max));
    }
    return value_->get<std::uint64_t>();
}

Eigen::VectorXd JsonNode::vector(std::size_t size) const
{
    if (!value_->is_array() || (value_->size() != size)) {
        fail("expected a list of " + std::to_string(size) + " numbers");
    }
    Eigen::VectorXd vector(static_cast<Eigen::Index>(size));
    for (std::size_t i = 0U; i < size; i++) {
        vector[static_cast<Eigen::Index>(i)] =
            JsonNode((*value_)[i], where_ + "[" + std::to_string(i) + "]").number();
    }
    return vector;
}

Eigen::MatrixXd JsonNode::matrix(std::size_t rows, std::size_t cols) const
{
    Eigen::MatrixXd matrix(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(cols));
    if ((cols == 0U) && (value_->is_null() || value_->empty())) {
        return matrix;
    }
    if (!value_->is_array() || (value_->size() != rows)) {
        fail("expected a list of " + std::to_string(rows) + " rows");
    }
    for (std::size_t i = 0U; i < rows; i++) {
        matrix.row(static_cast<Eigen::Index>(i)) =
            JsonNode((*value_)[i], where_ + "[" + std::to_string(i) + "]").vector(cols);
    }
    return matrix;
}

void JsonNode::fail(const std::string &message) const
{
    throw InputError(where_ + ": " + message);
}

Json read_json(const std::string &path)
{
    const std::string text = read_file(path);
    try {
        return Json::parse(text);
    } catch (const Json::parse_error &error) {
        const std::size_t at   = std::min(error.byte, text.size());
        const auto        head = text.substr(0U, at);
        const auto        line = 1 + std::count(head.begin(), head.end(), '\n');
        const std::size_t last = head.rfind('\n');
        const std::size_t col  = (last == std::string::npos) ? at : (at - last - 1U);
        throw InputError(path + ":" + std::to_string(line) + ":" + std::to_string(col)
                         + ": not valid JSON");
    } catch (const Json::out_of_range &) {
        throw InputError(path + ": a number is too large");
    }
}

} // namespace sim
