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
    auto loaded     = std::make_unique<KalmanTables>();
    loaded->model.K = tables.reals("K", static_cast<std::size_t>(plant.n) * plant.m);
    return loaded;
}

} // namespace sim
