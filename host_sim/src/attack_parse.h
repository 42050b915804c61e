/* SPDX-License-Identifier: MIT */
/** @file attack_parse.h  Attacks from TOML ([[attack]]) and from a recording's attacks.json. */
#ifndef BLW_SIM_ATTACK_PARSE_H
#define BLW_SIM_ATTACK_PARSE_H
#include "attack.h"
#include "toml_read.h"

namespace sim
{

/** The [[attack]] tables of a file; InputError with file, line and column.
 *
 *  Keys: id, sensor or sensors, kind, from and to (steps) or t0_s and t1_s (seconds), value (one
 *  number, or one per sensor), probability (drop), state (ghost), period_s, width_s, phase_rad,
 *  seed. */
std::vector<AttackSpec> parse_attacks(const TomlTable &file, const Design &design);

/** The attacks of FILE.toml, or of FILE.json: a list of {id, t0, t1, sensors, type, value, period,
 *  seed} with freeze = stuck and noise = white.  With an id, that one alone. */
std::vector<AttackSpec> read_attacks(const std::string &path, const std::string &id,
                                     const Design &design);

} // namespace sim
#endif
