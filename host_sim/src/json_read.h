/* SPDX-License-Identifier: MIT */
/** @file json_read.h  Checked access to JSON: every complaint names the file and the member. */
#ifndef BLW_SIM_JSON_READ_H
#define BLW_SIM_JSON_READ_H
#include <Eigen/Core>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace sim
{

using Json = nlohmann::ordered_json;

/** A JSON value and where it stands, "file: a.b.c". */
class JsonNode
{
public:
    /** @param value outlives the node */
    JsonNode(const Json &value, std::string where) : value_(&value), where_(std::move(where)) {}

    const Json &value() const
    {
        return *value_;
    }
    const std::string &where() const
    {
        return where_;
    }
    /** Present and not null. */
    bool has(const char *name) const;
    /** InputError if this is no object or has no such member. */
    JsonNode member(const char *name) const;

    std::string              text() const;
    std::vector<std::string> texts() const;
    double                   number() const;
    std::uint64_t            integer(std::uint64_t max) const;
    /** A list of `size` numbers. */
    Eigen::VectorXd vector(std::size_t size) const;
    /** A list of `rows` lists of `cols` numbers; with cols = 0 also an empty list or null. */
    Eigen::MatrixXd   matrix(std::size_t rows, std::size_t cols) const;
    [[noreturn]] void fail(const std::string &message) const;

private:
    const Json *value_;
    std::string where_;
};

/** The parsed file; InputError with file, line and column. */
Json read_json(const std::string &path);

} // namespace sim
#endif
