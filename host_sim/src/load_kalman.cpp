/* SPDX-License-Identifier: MIT */
#include "blw/blw_kalman.h"
#include "methods.h"

namespace sim
{
namespace
{

class KalmanTables final : public MethodTables
{
public:
    blw_kalman_model_t model{};
    blw_model_t       &head() override
    {
        return model.head;
    }
};

} // namespace

std::unique_ptr<MethodTables> load_kalman(TableReader &tables, const blw_plant_t &plant)
{
    auto              loaded = std::make_unique<KalmanTables>();
    const std::size_t n      = plant.n;
    loaded->model.K          = tables.reals("K", n * plant.m);
    loaded->model.Acl        = tables.reals_or_null("Acl", n * n);
    loaded->model.Bcl        = tables.reals_or_null("Bcl", n * plant.l);
    return loaded;
}

} // namespace sim
