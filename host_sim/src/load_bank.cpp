/* SPDX-License-Identifier: MIT */
#include "blw/blw_bank.h"
#include "methods.h"

namespace sim
{
namespace
{

class BankTables final : public MethodTables
{
public:
    blw_bank_model_t model{};
    blw_model_t     &head() override
    {
        return model.head;
    }
};

std::size_t sensors_in_all(const std::uint16_t *masks, std::size_t count)
{
    std::size_t sum = 0U;
    for (std::size_t i = 0U; i < count; i++) {
        sum += blw_mask_count(masks[i]);
    }
    return sum;
}

} // namespace

std::unique_ptr<MethodTables> load_bank(TableReader &tables, const blw_plant_t &plant)
{
    auto              loaded  = std::make_unique<BankTables>();
    blw_bank_model_t &model   = loaded->model;
    model.sets                = tables.integer<std::uint8_t>("sets");
    model.subsets             = tables.integer<std::uint8_t>("subsets");
    model.per_set             = tables.integer<std::uint8_t>("per_set");
    model.horizon             = tables.integer<std::uint8_t>("horizon");
    model.groups              = tables.integer<std::uint8_t>("groups");
    model.filtered            = tables.integer<std::uint8_t>("filtered");
    model.max_gap             = tables.integer<std::uint8_t>("max_gap");
    model.window              = tables.integer<std::uint16_t>("window");
    model.warm_up             = tables.integer<std::uint16_t>("warm_up");
    const std::size_t pairs   = std::size_t{model.sets} * model.per_set;
    model.set_mask            = tables.indices("set_mask", model.sets);
    model.subset_mask         = tables.indices("subset_mask", model.subsets);
    model.pair                = tables.indices("pair", pairs);
    const std::size_t members = sensors_in_all(model.set_mask, model.sets);
    const std::size_t columns = sensors_in_all(model.subset_mask, model.subsets);
    model.gain                = tables.real("gain");
    model.ceiling             = tables.real("ceiling");
    model.K                   = tables.reals("K", plant.n * members);
    model.Z                   = tables.reals("Z", plant.n * columns * model.horizon);
    model.scale               = tables.reals("scale", pairs);
    model.start               = tables.reals("start", pairs);
    model.gate                = tables.reals("gate", members);
    return loaded;
}

} // namespace sim
