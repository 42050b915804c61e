/* SPDX-License-Identifier: MIT */
/** @file controller.h  The known input: state feedback, waves, or both added. */
#ifndef BLW_SIM_CONTROLLER_H
#define BLW_SIM_CONTROLLER_H
#include "toml_read.h"
#include "design.h"
#include <string>
#include <vector>

namespace sim
{

/** constant v, sine v sin(2 pi t/period_s + phase_rad), or pulse: v during the first width_s of
 *  every period_s; added to one input. */
struct Wave {
    enum class Shape { constant, sine, pulse };
    Shape       shape     = Shape::constant;
    std::size_t input     = 0U;
    double      value     = 0.0;
    double      period_s  = 0.0;
    double      width_s   = 0.0;
    double      phase_rad = 0.0;
};

/** u(k) = gain (reference - x_hat(k)) + waves, i.e. u = -K x_hat with gain = K. */
struct ControllerSpec {
    bool              feedback = false;
    std::string       method; /* whose estimate is fed back; "truth" feeds back x itself */
    Eigen::MatrixXd   gain;   /* [l x n] */
    Eigen::VectorXd   reference;
    std::vector<Wave> waves;
};

/** [controller] of a scenario.
 *
 *  kind = "feedback" (method, gain, reference), "wave" or "none"; [[controller.wave]] with input,
 *  shape, value, period_s, width_s, phase_rad for "feedback" and "wave". */
ControllerSpec parse_controller(const TomlTable &controller, const Design &design);

/** u at time t_s [l] for the estimate x_hat [n], which counts only for feedback. */
Eigen::VectorXd control(const ControllerSpec &spec, const Design &design, double t_s,
                        const Eigen::VectorXd &x_hat);

} // namespace sim
#endif
