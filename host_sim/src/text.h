/* SPDX-License-Identifier: MIT */
/** @file text.h  Numbers and files as text, independent of the locale. */
#ifndef BLW_SIM_TEXT_H
#define BLW_SIM_TEXT_H
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace sim
{

/** The shortest text that reads back as exactly this number. */
std::string shortest(double value);
/** Text with that many significant digits. */
std::string with_digits(double value, int digits);
/** A finite number that fills the whole text, or nothing. */
std::optional<double> parse_number(std::string_view text);
/** a, b, c */
std::string join(const std::vector<std::string> &words, const char *separator);
/** The file's bytes; InputError if it cannot be read. */
std::string read_file(const std::string &path);

/** Files that appear together or not at all: written under temporary names, then renamed. */
class OutputSet
{
public:
    explicit OutputSet(std::string directory);
    ~OutputSet();
    OutputSet(const OutputSet &)            = delete;
    OutputSet &operator=(const OutputSet &) = delete;

    void add(const std::string &name, std::string content);
    /** Make the directory if needed, write and rename all; InputError if one cannot be written. */
    void commit();

private:
    std::string                                      directory_;
    std::vector<std::pair<std::string, std::string>> files_;
    std::vector<std::string>                         temporary_;
};

} // namespace sim
#endif
