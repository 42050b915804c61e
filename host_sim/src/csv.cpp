/* SPDX-License-Identifier: MIT */
#include "csv.h"
#include "error.h"
#include "text.h"
#include <algorithm>

namespace sim
{
namespace
{

const std::string_view BYTE_ORDER_MARK = "\xEF\xBB\xBF";

std::string_view trimmed(std::string_view cell)
{
    while (!cell.empty() && ((cell.front() == ' ') || (cell.front() == '\t'))) {
        cell.remove_prefix(1U);
    }
    while (!cell.empty() && ((cell.back() == ' ') || (cell.back() == '\t'))) {
        cell.remove_suffix(1U);
    }
    if ((cell.size() >= 2U) && (cell.front() == '"') && (cell.back() == '"')) {
        cell = cell.substr(1U, cell.size() - 2U);
    }
    return cell;
}

} // namespace

CsvFile::CsvFile(const std::string &path) : path_(path), text_(read_file(path))
{
    if (text_.find('\0') != std::string::npos) {
        throw InputError(path_ + ": is no text in ASCII or UTF-8: it has zero bytes");
    }
    if (std::string_view(text_).substr(0U, BYTE_ORDER_MARK.size()) == BYTE_ORDER_MARK) {
        next_ = BYTE_ORDER_MARK.size();
    }
    std::string_view line;
    if (!read_line(line)) {
        throw InputError(path_ + ": is empty");
    }
    split(line);
    for (std::size_t i = 0U; i < cells_.size(); i++) {
        const std::string name(cells_[i]);
        if (name.empty() || find(name)) {
            fail(i, name.empty() ? "column without a name" : "column \"" + name + "\" twice");
        }
        header_.push_back(name);
    }
}

std::optional<std::size_t> CsvFile::find(const std::string &name) const
{
    const auto found = std::find(header_.begin(), header_.end(), name);
    if (found == header_.end()) {
        return std::nullopt;
    }
    return static_cast<std::size_t>(found - header_.begin());
}

bool CsvFile::next()
{
    std::string_view line;
    if (!read_line(line)) {
        return false;
    }
    split(line);
    if (cells_.size() != header_.size()) {
        fail(std::min(cells_.size(), header_.size()) - 1U,
             "row with " + std::to_string(cells_.size()) + " cells, the header has "
                 + std::to_string(header_.size()));
    }
    return true;
}

std::optional<double> CsvFile::number(std::size_t column) const
{
    if (cells_[column].empty()) {
        return std::nullopt;
    }
    const std::optional<double> value = parse_number(cells_[column]);
    if (!value) {
        fail(column, "\"" + std::string(cells_[column]) + "\" is not a finite number");
    }
    return value;
}

double CsvFile::required(std::size_t column) const
{
    const std::optional<double> value = number(column);
    if (!value) {
        fail(column, "empty, but needed in every row");
    }
    return *value;
}

void CsvFile::fail(std::size_t column, const std::string &message) const
{
    const bool named = column < header_.size();
    throw InputError(position(column) + ": " + (named ? header_[column] + ": " : "") + message);
}

/* Blank lines at the end of the file are no rows. */
bool CsvFile::read_line(std::string_view &line)
{
    if (text_.find_first_not_of(" \t\r\n", next_) == std::string::npos) {
        return false;
    }
    const std::size_t end = std::min(text_.find('\n', next_), text_.size());
    line                  = std::string_view(text_).substr(next_, end - next_);
    if (!line.empty() && (line.back() == '\r')) {
        line.remove_suffix(1U);
    }
    next_ = std::min(end + 1U, text_.size());
    line_++;
    return true;
}

void CsvFile::split(std::string_view line)
{
    cells_.clear();
    starts_.clear();
    std::size_t start = 0U;
    while (start <= line.size()) {
        const std::size_t end = std::min(line.find(',', start), line.size());
        cells_.push_back(trimmed(line.substr(start, end - start)));
        starts_.push_back(start + 1U);
        start = end + 1U;
    }
}

std::string CsvFile::position(std::size_t column) const
{
    return path_ + ":" + std::to_string(line_) + ":" + std::to_string(starts_[column]);
}

} // namespace sim
