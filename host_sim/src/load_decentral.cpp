/* SPDX-License-Identifier: MIT */
#include "blw/blw_decentral.h"
#include "error.h"
#include "methods.h"
#include <algorithm>

namespace sim
{
namespace
{

class DecentralTables final : public MethodTables
{
public:
    blw_decentral_sets_t      sets{};
    blw_decentral_ranking_t   ranking{};
    blw_decentral_steady_t    steady{};
    blw_decentral_recursive_t recursive{};
    blw_decentral_model_t     model{};
    blw_model_t              &head() override
    {
        return model.head;
    }
};

/* Lengths that follow from the numbers of local states. */
struct Sizes {
    std::size_t n, m, mu;
    std::size_t blocks = 0U; /* sum of mu_i^2 */
    std::size_t Q      = 0U;
    std::size_t H      = 0U; /* sum of mu_i (mu_i + 1) / 2 */

    Sizes(const blw_plant_t &plant, const blw_decentral_model_t &model)
        : n(plant.n), m(plant.m), mu(model.mu)
    {
        for (std::size_t i = 0U; i < m; i++) {
            const std::size_t end   = model.first[i + 1U];
            const std::size_t local = end - model.first[i];
            blocks += local * local;
            Q += local * std::min(end, mu - n);
            H += (local * (local + 1U)) / 2U;
        }
    }
};

void load_sets(TableReader tables, blw_decentral_sets_t &sets)
{
    sets.n_sets       = tables.integer<std::uint16_t>("n_sets");
    sets.n_candidates = tables.integer<std::uint16_t>("n_candidates");
    sets.parent       = tables.indices("parent", sets.n_sets);
    sets.sensor       = tables.indices("sensor", sets.n_sets);
    if (sets.n_candidates > 0U) {
        sets.candidate = tables.indices("candidate", sets.n_candidates);
    }
}

void load_ranking(TableReader tables, blw_decentral_ranking_t &ranking)
{
    ranking.n_dof            = tables.integer<std::uint16_t>("n_dof");
    ranking.n_ranked         = tables.integer<std::uint16_t>("n_ranked");
    ranking.n_knots          = tables.integer<std::uint16_t>("n_knots");
    const std::size_t ranked = ranking.n_ranked;
    ranking.removed          = tables.indices("removed", ranking.n_dof);
    ranking.thr              = tables.reals("thr", ranking.n_dof);
    ranking.knots            = tables.reals("knots", ranking.n_knots);
    ranking.c                = tables.reals("c", ranked * ranking.n_knots);
}

void load_steady(TableReader tables, const Sizes &sizes, std::size_t n_sets,
                 blw_decentral_steady_t &steady)
{
    const std::size_t d = sizes.mu - sizes.n;
    steady.d            = tables.integer<std::uint16_t>("d");
    steady.F            = tables.reals("F", sizes.blocks);
    steady.K            = tables.reals("K", sizes.mu);
    steady.N            = tables.reals("N", d * sizes.mu - (d * (d - 1U)) / 2U);
    steady.Psi          = tables.reals("Psi", sizes.n * sizes.mu);
    steady.Q            = tables.reals("Q", sizes.Q);
    steady.Y            = tables.reals("Y", sizes.mu * sizes.n);
    steady.H            = tables.reals_or_null("H", sizes.H);
    steady.at           = tables.indices("at", n_sets + 1U);
    steady.M            = tables.reals("M", steady.at[n_sets]);
}

void load_recursive(TableReader tables, const Sizes &sizes, blw_decentral_recursive_t &recursive)
{
    recursive.S   = tables.reals("S", sizes.blocks);
    recursive.t   = tables.reals("t", sizes.mu);
    recursive.V   = tables.reals("V", sizes.mu * sizes.n);
    recursive.E   = tables.reals("E", (sizes.m * (sizes.m + 1U)) / 2U);
    recursive.L0  = tables.reals("L0", sizes.mu * sizes.n);
    recursive.Psi = tables.reals("Psi", sizes.n * sizes.mu);
}

/* The members of the model itself, up to the nested structures. */
void load_head(TableReader &tables, const blw_plant_t &plant, blw_decentral_model_t &model)
{
    model.mu      = tables.integer<std::uint16_t>("mu");
    model.rows    = tables.integer<std::uint16_t>("rows");
    model.warm_up = tables.integer<std::uint16_t>("warm_up");
    model.readmit = tables.integer<std::uint16_t>("readmit");
    model.max_gap = tables.integer<std::uint16_t>("max_gap");
    model.reseed  = tables.integer<std::uint8_t>("reseed");
    model.first   = tables.indices("first", plant.m + std::size_t{1U});
    if ((model.mu <= plant.n) || (model.first[0] != 0U) || (model.first[plant.m] != model.mu)
        || !std::is_sorted(model.first, model.first + plant.m + 1U)) {
        throw InputError("decentral: tables.first must grow from 0 to mu, and mu must exceed n");
    }
    model.Phi   = tables.reals("Phi", static_cast<std::size_t>(model.mu) * plant.n);
    model.scale = tables.reals("scale", plant.m);
}

} // namespace

std::unique_ptr<MethodTables> load_decentral(TableReader &tables, const blw_plant_t &plant)
{
    auto                   loaded = std::make_unique<DecentralTables>();
    blw_decentral_model_t &model  = loaded->model;
    load_head(tables, plant, model);
    const Sizes sizes(plant, model);
    load_sets(tables.nested("sets"), loaded->sets);
    load_ranking(tables.nested("ranking"), loaded->ranking);
    if (tables.has("steady")) {
        model.gains = &blw_decentral_steady_ops;
        load_steady(tables.nested("steady"), sizes, loaded->sets.n_sets, loaded->steady);
        model.steady = &loaded->steady;
    } else {
        model.gains = &blw_decentral_recursive_ops;
        load_recursive(tables.nested("recursive"), sizes, loaded->recursive);
        model.recursive = &loaded->recursive;
    }
    model.sets    = &loaded->sets;
    model.ranking = &loaded->ranking;
    return loaded;
}

} // namespace sim
