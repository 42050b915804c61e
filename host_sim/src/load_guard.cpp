/* SPDX-License-Identifier: MIT */
#include "blw/blw_guard.h"
#include "error.h"
#include "methods.h"

namespace sim
{
namespace
{

class GuardTables final : public MethodTables
{
public:
    blw_guard_model_t model{};
    blw_model_t      &head() override
    {
        return model.head;
    }
};

const blw_guard_solver_t *solver(const JsonNode &name)
{
    if (name.text() == "one") {
        return &blw_guard_one_ops;
    }
    if (name.text() != "many") {
        name.fail("unknown solver '" + name.text() + "'");
    }
    return &blw_guard_many_ops;
}

/* The small members, from which the lengths of the tables follow. */
void load_sizes(TableReader &tables, const blw_plant_t &plant, blw_guard_model_t &model)
{
    model.r           = tables.integer<std::uint8_t>("r");
    model.reach       = tables.integer<std::uint8_t>("reach");
    model.n_u         = tables.integer<std::uint8_t>("n_u");
    model.n_units     = tables.integer<std::uint8_t>("n_units");
    model.most        = tables.integer<std::uint8_t>("most");
    model.search      = tables.integer<std::uint8_t>("search");
    model.pairs       = tables.integer<std::uint8_t>("pairs");
    model.max_updates = tables.integer<std::uint16_t>("max_updates");
    model.warm_up     = tables.integer<std::uint16_t>("warm_up");
    model.solver      = solver(tables.member("solver"));
    model.unit        = tables.indices("unit", plant.m);
    model.rank        = tables.indices("rank", plant.m);
    if ((model.n_u > plant.n) || (model.reach < 1U) || (model.reach > model.r)) {
        throw InputError("guard: tables.n_u must be at most n, tables.reach from 1 to r");
    }
}

} // namespace

std::unique_ptr<MethodTables> load_guard(TableReader &tables, const blw_plant_t &plant)
{
    auto               loaded = std::make_unique<GuardTables>();
    blw_guard_model_t &model  = loaded->model;
    load_sizes(tables, plant, model);
    const std::size_t r       = model.r;
    const std::size_t N       = r * plant.m;
    const std::size_t n_u     = model.n_u;
    const std::size_t n_s     = plant.n - n_u;
    const std::size_t outside = r - model.reach;
    const std::size_t others  = (model.pairs != 0U) ? (N * (plant.m - 1U)) : 0U;
    model.Lam     = tables.reals("Lam", plant.m * (r * r - outside * (outside - 1U) / 2U));
    model.b       = tables.reals("b", plant.m * model.reach);
    model.S       = tables.reals("S", (r * r * plant.m * (plant.m - 1U)) / 2U);
    model.V       = tables.reals("V", others * r);
    model.s       = tables.reals("s", others);
    model.Fu      = tables.reals("Fu", n_u * N);
    model.Gu      = tables.reals("Gu", n_u * N);
    model.Xu      = tables.reals("Xu", (n_s > 0U) ? (plant.n * n_u) : 0U);
    model.Xs      = tables.reals("Xs", plant.n * n_s);
    model.Sig     = tables.reals("Sig", n_s * N);
    model.effect  = tables.reals("effect", plant.m);
    model.drift   = tables.reals("drift", plant.m);
    model.k       = tables.real("k");
    model.exclude = tables.real("exclude");
    model.gross   = tables.real("gross");
    model.gain    = tables.real("gain");
    model.kappa   = tables.real("kappa");
    model.omega   = tables.real("omega");
    model.sigma   = tables.real("sigma");
    return loaded;
}

} // namespace sim
