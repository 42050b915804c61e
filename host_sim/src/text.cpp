/* SPDX-License-Identifier: MIT */
#include "text.h"
#include "error.h"
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <unistd.h>

namespace sim
{
namespace fs = std::filesystem;

std::string shortest(double value)
{
    std::array<char, 40> buffer{};
    const auto           end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
    return std::string(buffer.data(), end.ptr);
}

std::string with_digits(double value, int digits)
{
    std::array<char, 40> buffer{};
    const auto           end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value,
                                             std::chars_format::general, digits);
    return std::string(buffer.data(), end.ptr);
}

std::optional<double> parse_number(std::string_view text)
{
    if (!text.empty() && (text.front() == '+')) {
        text.remove_prefix(1U);
    }
    double     value = 0.0;
    const auto end   = std::from_chars(text.data(), text.data() + text.size(), value);
    if ((end.ec != std::errc()) || (end.ptr != text.data() + text.size())
        || !std::isfinite(value)) {
        return std::nullopt;
    }
    return value;
}

std::string join(const std::vector<std::string> &words, const char *separator)
{
    std::string text;
    for (const std::string &word : words) {
        text += text.empty() ? word : separator + word;
    }
    return text;
}

std::string read_file(const std::string &path)
{
    std::error_code ignored;
    if (fs::is_directory(path, ignored)) {
        throw InputError(path + ": is a directory, not a file");
    }
    std::ifstream in(path, std::ios::binary);
    if (!in) {
        throw InputError(path + ": cannot be read");
    }
    std::ostringstream text;
    text << in.rdbuf();
    return text.str();
}

OutputSet::OutputSet(std::string directory) : directory_(std::move(directory)) {}

OutputSet::~OutputSet()
{
    for (const std::string &name : temporary_) {
        std::error_code ignored;
        fs::remove(name, ignored);
    }
}

void OutputSet::add(const std::string &name, std::string content)
{
    files_.emplace_back(name, std::move(content));
}

void OutputSet::commit()
{
    std::error_code error;
    fs::create_directories(directory_, error);
    if (error) {
        throw InputError(directory_ + ": cannot be made: " + error.message());
    }
    for (const auto &[name, content] : files_) {
        temporary_.push_back(directory_ + "/." + name + "." + std::to_string(::getpid()));
        std::ofstream out(temporary_.back(), std::ios::binary);
        out << content;
        out.close();
        if (!out) {
            throw InputError(directory_ + "/" + name + ": cannot be written");
        }
    }
    for (std::size_t i = 0U; i < files_.size(); i++) {
        const std::string target = directory_ + "/" + files_[i].first;
        fs::rename(temporary_[i], target, error);
        if (error) {
            throw InputError(target + ": cannot be written: " + error.message());
        }
    }
    temporary_.clear();
}

} // namespace sim
