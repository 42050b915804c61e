/* SPDX-License-Identifier: MIT */
/** @file error.h  Bad input: what() is one line, what is wrong and where; exit status 2. */
#ifndef BLW_SIM_ERROR_H
#define BLW_SIM_ERROR_H
#include <stdexcept>

namespace sim
{

class InputError : public std::runtime_error
{
public:
    using std::runtime_error::runtime_error;
};

} // namespace sim
#endif
