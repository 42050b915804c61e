/* SPDX-License-Identifier: MIT */
/** @file tables.h  JSON tables as arrays of the library's number type.
 *
 *  A loader reads the members of a C model in the order in which the structure declares them; each
 *  real table that is read is added to the library's own walk (blw_table_add), which gives the
 *  checksum of the model.
 */
#ifndef BLW_SIM_TABLES_H
#define BLW_SIM_TABLES_H
#include "blw/blw_model.h"
#include "json_read.h"
#include <cstdint>
#include <deque>
#include <limits>
#include <vector>

namespace sim
{

/** Owner of the arrays that C structures point to; they stay where they are as it grows. */
class TableStore
{
public:
    const blw_real_t    *keep(std::vector<blw_real_t> table);
    const std::uint16_t *keep(std::vector<std::uint16_t> table);

private:
    std::deque<std::vector<blw_real_t>>    reals_;
    std::deque<std::vector<std::uint16_t>> indices_;
};

/** Reader of one object of tables. */
class TableReader
{
public:
    /** @param store, walk outlive the reader */
    TableReader(JsonNode node, TableStore &store, blw_table_check_t &walk)
        : node_(std::move(node)), store_(&store), walk_(&walk)
    {
    }

    /** A table of `length` numbers, flattened; with length = 0 NULL. */
    const blw_real_t *reals(const char *name, std::size_t length);
    /** The same, or NULL if the member is null. */
    const blw_real_t *reals_or_null(const char *name, std::size_t length);
    blw_real_t        real(const char *name);
    /** A table of `length` small integers. */
    const std::uint16_t    *indices(const char *name, std::size_t length);
    template <typename T> T integer(const char *name) const
    {
        return static_cast<T>(node_.member(name).integer(std::numeric_limits<T>::max()));
    }
    /** A member that is no table. */
    JsonNode member(const char *name) const
    {
        return node_.member(name);
    }
    /** Present and not null. */
    bool has(const char *name) const
    {
        return node_.has(name);
    }
    TableReader nested(const char *name) const;
    TableStore &store() const
    {
        return *store_;
    }

private:
    JsonNode           node_;
    TableStore        *store_;
    blw_table_check_t *walk_;
};

/** A number as the library's type, to nearest; out of its range becomes infinite. */
blw_real_t narrow(double value);

} // namespace sim
#endif
