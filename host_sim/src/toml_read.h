/* SPDX-License-Identifier: MIT */
/** @file toml_read.h  Checked access to TOML: every complaint names file, line and column. */
#ifndef BLW_SIM_TOML_READ_H
#define BLW_SIM_TOML_READ_H
#include <Eigen/Core>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <toml++/toml.h>
#include <vector>

namespace sim
{

/** The parsed file; InputError with file, line and column. */
toml::table read_toml(const std::string &path);

/** One table of a file. */
class TomlTable
{
public:
    /** InputError if the table has a key that is not among the known ones.
     *  @param table outlives the object */
    TomlTable(const toml::table &table, std::string path,
              std::initializer_list<const char *> known);
    /** A table whose keys the caller checks itself. */
    TomlTable(const toml::table &table, std::string path);

    void check_keys(const std::vector<std::string> &known) const;

    bool has(const char *key) const
    {
        return table_->contains(key);
    }
    /** "file:line:column" of the key's value, or of the table. */
    std::string       where(const char *key) const;
    const toml::node *node(const char *key) const
    {
        return table_->get(key);
    }

    std::optional<double>        number(const char *key) const;
    std::optional<std::uint64_t> integer(const char *key) const;
    std::optional<std::string>   text(const char *key) const;
    /** A list of numbers; one number counts as a list of one. */
    std::optional<std::vector<double>>      numbers(const char *key) const;
    std::optional<std::vector<std::string>> texts(const char *key) const;
    /** A list of `rows` lists of `cols` numbers. */
    Eigen::MatrixXd matrix(const char *key, std::size_t rows, std::size_t cols) const;
    /** [key] or nullptr. */
    const toml::table *table(const char *key) const;
    /** All of [[key]]. */
    std::vector<const toml::table *> tables(const char *key) const;
    const std::string               &path() const
    {
        return path_;
    }
    /** InputError "file:line:column: key: message". */
    [[noreturn]] void fail(const char *key, const std::string &message) const;

private:
    const toml::table *table_;
    std::string        path_;
};

} // namespace sim
#endif
