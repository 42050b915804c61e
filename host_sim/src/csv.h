/* SPDX-License-Identifier: MIT */
/** @file csv.h  Comma-separated text, strictly: every complaint names file, line and column. */
#ifndef BLW_SIM_CSV_H
#define BLW_SIM_CSV_H
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace sim
{

/** A file read row by row.  Cells may be in double quotes but hold no comma or line break. */
class CsvFile
{
public:
    /** Reads the header; InputError if there is none or a name is empty or given twice. */
    explicit CsvFile(const std::string &path);
    CsvFile(const CsvFile &)            = delete;
    CsvFile &operator=(const CsvFile &) = delete;

    const std::vector<std::string> &header() const
    {
        return header_;
    }
    /** Position of a column, or nothing. */
    std::optional<std::size_t> find(const std::string &name) const;
    /** Go to the next row; false at the end.  InputError unless it has a cell per column. */
    bool next();
    /** The number in a cell of this row, nothing if it is empty; InputError if it is no number. */
    std::optional<double> number(std::size_t column) const;
    /** The same for a cell that must not be empty. */
    double required(std::size_t column) const;
    /** InputError "file:line:column: message" for a cell of the current row. */
    [[noreturn]] void fail(std::size_t column, const std::string &message) const;

private:
    bool        read_line(std::string_view &line);
    void        split(std::string_view line);
    std::string position(std::size_t column) const;

    std::string                   path_;
    std::string                   text_;
    std::size_t                   next_ = 0U; /* start of the next line */
    std::size_t                   line_ = 0U; /* number of the current one */
    std::vector<std::string>      header_;
    std::vector<std::string_view> cells_;
    std::vector<std::size_t>      starts_; /* of the cells in their line, from 1 */
};

} // namespace sim
#endif
