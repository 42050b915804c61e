/* SPDX-License-Identifier: MIT */
/** @file attack.h  Attacks on measurements: what they do and when.
 *
 *  An attack sees the measurement with its noise and changes the sensors it holds while it lasts:
 *  from <= k < to in steps, or t0_s <= t < t1_s in seconds.  A sample that the sensor did not send
 *  stays missing.  e = time since the attack began, v = value, and by kind the sample becomes
 *    bias y + v, scale v y, ramp y + v e/duration, sine y + v sin(2 pi e/period_s + phase_rad),
 *    pulse y + v during the first width_s of every period_s, white y + N(0, v^2),
 *    uniform y + U(-v, v), zero 0, sign_flip -y, stuck = the last sample before the attack,
 *    replay = the sample of v seconds ago, or the last one before that (stuck and replay leave the
 *    sample alone while there is nothing to repeat),
 *    delay = what the sensor sent v seconds ago, if it sent anything,
 *    drop = missing, with that probability (1 unless given),
 *    ghost y + C xg, xg(0) = state, xg(k+1) = A xg(k): a consistent trajectory that is not there,
 *    innovation_aligned y + v r/|r|, r = the innovations of the sensors held, as a Kalman filter
 *    sees them that is fed the attacked samples.
 */
#ifndef BLW_SIM_ATTACK_H
#define BLW_SIM_ATTACK_H
#include "design.h"
#include "random.h"
#include <optional>
#include <string>
#include <vector>

namespace sim
{

enum class AttackKind {
    bias,
    scale,
    ramp,
    sine,
    pulse,
    white,
    uniform,
    zero,
    sign_flip,
    stuck,
    replay,
    delay,
    drop,
    ghost,
    innovation_aligned
};

struct AttackSpec {
    std::string                  id;
    AttackKind                   kind = AttackKind::bias;
    std::vector<std::size_t>     sensors;
    std::vector<double>          value; /* one per sensor */
    Eigen::VectorXd              state; /* ghost: [n] */
    double                       period_s  = 0.0;
    double                       width_s   = 0.0;
    double                       phase_rad = 0.0;
    std::optional<std::uint64_t> seed;
    /* The window: in seconds if t0_s is given, else in steps; open to the end of the log. */
    std::uint64_t                from = 1U;
    std::optional<std::uint64_t> to;
    std::optional<double>        t0_s, t1_s;
};

const char *kind_name(AttackKind kind);

/** Samples of one step.  What is not in `valid` is missing. */
struct Samples {
    Eigen::VectorXd y; /* [m] */
    blw_mask_t      valid = 0U;
};

/** Samples after the attacks. */
struct AttackedSamples {
    Samples         samples;
    Eigen::VectorXd a;             /* [m] what was added */
    blw_mask_t      attacked = 0U; /* samples that were changed or withheld */
    blw_mask_t      active   = 0U; /* sensors held by an attack at this step */
};

/** Position of a step in its log. */
struct Instant {
    std::uint64_t k   = 0U;
    double        t_s = 0.0;
};

/** All attacks of one run, applied one after the other. */
class Attacker
{
public:
    /** @param design outlives the attacker
     *  @param end the last instant of the run: an attack without an end lasts to the step after */
    Attacker(const Design &design, std::vector<AttackSpec> specs, Instant end, std::uint64_t seed);

    /** Steps are to be given in order from k = 1.  u is u(k-1). */
    AttackedSamples apply(Instant now, const Eigen::VectorXd &u, const Samples &honest);

private:
    struct Attack {
        AttackSpec      spec;
        Random          random;
        Eigen::VectorXd ghost;        /* xg */
        Eigen::VectorXd direction;    /* r/|r|, one entry per sensor held */
        std::size_t     steps_before; /* history when the attack began */
        bool            begun;
    };

    double slack_s() const; /* t = k dt is rounded */
    bool   active(const AttackSpec &spec, Instant now) const;
    double elapsed_s(const AttackSpec &spec, Instant now) const;
    double duration_s(const AttackSpec &spec) const;
    /* Advance the attack itself by one step. */
    void prepare(Attack &attack, const Samples &samples);
    /* The sample that takes the place of y, if one is sent. */
    double replaced(Attack &attack, std::size_t slot, Instant now, double y);
    /* Whether one is sent. */
    bool            sent(Attack &attack, std::size_t slot, bool valid);
    Eigen::VectorXd innovation_direction(const AttackSpec &spec, const Samples &samples) const;
    void            watch(const Samples &samples);
    /* The newest sample of the sensor among the first `count` of the history. */
    std::optional<double> newest(std::size_t sensor, std::size_t count) const;
    /* Length of the history at that age. */
    std::size_t count_ago(double age_s) const;

    const Design        *design_;
    std::vector<Attack>  attacks_;
    Instant              end_;
    std::vector<Samples> history_; /* honest samples from k = 1 to now */
    Eigen::VectorXd      x_bar_;   /* of the attacker's Kalman filter: prediction, */
    Eigen::VectorXd      x_hat_;   /* estimate */
};

} // namespace sim
#endif
