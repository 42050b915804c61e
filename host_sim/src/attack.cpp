/* SPDX-License-Identifier: MIT */
#include "attack.h"
#include "constants.h"
#include <algorithm>
#include <cmath>

namespace sim
{
namespace
{

/* Streams of random numbers below this one belong to the plant. */
const std::uint64_t FIRST_STREAM = 100U;

blw_mask_t bit(std::size_t sensor)
{
    return static_cast<blw_mask_t>(1) << sensor;
}

double &at(Eigen::VectorXd &vector, std::size_t i)
{
    return vector[static_cast<Eigen::Index>(i)];
}

} // namespace

Attacker::Attacker(const Design &design, std::vector<AttackSpec> specs, Instant end,
                   std::uint64_t seed)
    : design_(&design), end_(end), x_bar_(design.x0), x_hat_(design.x0)
{
    for (AttackSpec &spec : specs) {
        const std::uint64_t stream = FIRST_STREAM + attacks_.size();
        const Random        random(spec.seed.value_or(seed), stream);
        attacks_.push_back({std::move(spec), random, {}, {}, 0U, false});
    }
}

AttackedSamples Attacker::apply(Instant now, const Eigen::VectorXd &u, const Samples &honest)
{
    AttackedSamples out;
    out.samples = honest;
    x_bar_      = design_->A * x_hat_ + design_->Bu * u;
    history_.push_back(honest);
    for (Attack &attack : attacks_) {
        if (!active(attack.spec, now)) {
            continue;
        }
        prepare(attack, out.samples);
        for (std::size_t slot = 0U; slot < attack.spec.sensors.size(); slot++) {
            const std::size_t sensor = attack.spec.sensors[slot];
            const blw_mask_t  others = out.samples.valid & ~bit(sensor);
            double           &y      = at(out.samples.y, sensor);
            y                        = replaced(attack, slot, now, y);
            const bool arrives       = sent(attack, slot, (out.samples.valid & bit(sensor)) != 0U);
            out.samples.valid        = others | (arrives ? bit(sensor) : 0U);
            out.active |= bit(sensor);
        }
    }
    out.a = Eigen::VectorXd::Zero(honest.y.size());
    for (std::size_t i = 0U; i < design_->m; i++) {
        if ((out.samples.valid & bit(i)) != 0U) {
            at(out.a, i) = at(out.samples.y, i) - at(history_.back().y, i);
        }
        const bool changed  = (at(out.a, i) < 0.0) || (at(out.a, i) > 0.0);
        const bool withheld = ((honest.valid & ~out.samples.valid) & bit(i)) != 0U;
        out.attacked |= (changed || withheld) ? bit(i) : 0U;
    }
    watch(out.samples);
    return out;
}

double Attacker::slack_s() const
{
    return 1e-6 * design_->dt_s;
}

bool Attacker::active(const AttackSpec &spec, Instant now) const
{
    if (!spec.t0_s) {
        return (now.k >= spec.from) && (!spec.to || (now.k < *spec.to));
    }
    const double t_s = now.t_s + slack_s();
    return (t_s >= *spec.t0_s) && (!spec.t1_s || (t_s < *spec.t1_s));
}

double Attacker::elapsed_s(const AttackSpec &spec, Instant now) const
{
    return spec.t0_s ? (now.t_s - *spec.t0_s)
                     : (static_cast<double>(now.k - spec.from) * design_->dt_s);
}

double Attacker::duration_s(const AttackSpec &spec) const
{
    if (spec.t0_s) {
        return spec.t1_s.value_or(end_.t_s + design_->dt_s) - *spec.t0_s;
    }
    return static_cast<double>(spec.to.value_or(end_.k + 1U) - spec.from) * design_->dt_s;
}

void Attacker::prepare(Attack &attack, const Samples &samples)
{
    const bool first = !attack.begun;
    if (first) {
        attack.begun        = true;
        attack.steps_before = history_.size() - 1U;
    }
    if (attack.spec.kind == AttackKind::ghost) {
        attack.ghost = first ? attack.spec.state : (design_->A * attack.ghost).eval();
    }
    if (attack.spec.kind == AttackKind::innovation_aligned) {
        attack.direction = innovation_direction(attack.spec, samples);
    }
}

double Attacker::replaced(Attack &attack, std::size_t slot, Instant now, double y)
{
    const AttackSpec &spec    = attack.spec;
    const std::size_t sensor  = spec.sensors[slot];
    const double      value   = spec.value[slot];
    const double      elapsed = elapsed_s(spec, now);
    switch (spec.kind) {
    case AttackKind::bias:
        return y + value;
    case AttackKind::scale:
        return y * value;
    case AttackKind::ramp:
        return y + value * elapsed / duration_s(spec);
    case AttackKind::sine:
        return y + value * std::sin(TWO_PI * elapsed / spec.period_s + spec.phase_rad);
    case AttackKind::pulse:
        return std::fmod(elapsed + slack_s(), spec.period_s) < spec.width_s ? (y + value) : y;
    case AttackKind::white:
        return y + value * attack.random.normal();
    case AttackKind::uniform:
        return y + value * (2.0 * attack.random.uniform() - 1.0);
    case AttackKind::zero:
        return 0.0;
    case AttackKind::sign_flip:
        return -y;
    case AttackKind::stuck:
        return newest(sensor, attack.steps_before).value_or(y);
    case AttackKind::replay:
    case AttackKind::delay:
        return newest(sensor, count_ago(value)).value_or(y);
    case AttackKind::ghost:
        return y + design_->C.row(static_cast<Eigen::Index>(sensor)).dot(attack.ghost);
    case AttackKind::innovation_aligned:
        return y + value * attack.direction[static_cast<Eigen::Index>(slot)];
    case AttackKind::drop:
        break;
    }
    return y;
}

bool Attacker::sent(Attack &attack, std::size_t slot, bool valid)
{
    if (attack.spec.kind == AttackKind::drop) {
        return (attack.random.uniform() >= attack.spec.value[slot]) && valid;
    }
    if (attack.spec.kind == AttackKind::delay) {
        const std::size_t count = count_ago(attack.spec.value[slot]);
        return (count > 0U)
               && ((history_[count - 1U].valid & bit(attack.spec.sensors[slot])) != 0U);
    }
    return valid;
}

Eigen::VectorXd Attacker::innovation_direction(const AttackSpec &spec, const Samples &samples) const
{
    Eigen::VectorXd r = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(spec.sensors.size()));
    for (std::size_t slot = 0U; slot < spec.sensors.size(); slot++) {
        const auto i = static_cast<Eigen::Index>(spec.sensors[slot]);
        if ((samples.valid & bit(spec.sensors[slot])) != 0U) {
            r[static_cast<Eigen::Index>(slot)] =
                samples.y[i] - design_->offset[i] - design_->C.row(i).dot(x_bar_);
        }
    }
    return r.stableNormalized();
}

/* The victim's filter as the attacker knows it: steady-state gain, fed what the victim gets. */
void Attacker::watch(const Samples &samples)
{
    const blw_mask_t used       = usable(*design_, samples.y, samples.valid);
    Eigen::VectorXd  innovation = samples.y - design_->offset - design_->C * x_bar_;
    for (std::size_t i = 0U; i < design_->m; i++) {
        if ((used & bit(i)) == 0U) {
            at(innovation, i) = 0.0;
        }
    }
    x_hat_ = x_bar_ + design_->K * innovation;
}

std::size_t Attacker::count_ago(double age_s) const
{
    const double steps = std::round(age_s / design_->dt_s);
    const double count = static_cast<double>(history_.size());
    return (steps < count) ? static_cast<std::size_t>(count - steps) : 0U;
}

std::optional<double> Attacker::newest(std::size_t sensor, std::size_t count) const
{
    for (std::size_t i = count; i-- > 0U;) {
        if ((history_[i].valid & bit(sensor)) != 0U) {
            return history_[i].y[static_cast<Eigen::Index>(sensor)];
        }
    }
    return std::nullopt;
}

} // namespace sim
