/* SPDX-License-Identifier: MIT */
#include "blw/blw_lasso.h"
#include "methods.h"
#include <map>

namespace sim
{
namespace
{

class LassoTables final : public MethodTables
{
public:
    blw_jordan_model_t jordan{};
    blw_l1_model_t     l1{};
    blw_lasso_model_t  model{};
    blw_model_t       &head() override
    {
        return model.head;
    }
};

void load_jordan(TableReader tables, const blw_plant_t &plant, blw_jordan_model_t &model)
{
    model.r             = tables.integer<std::uint8_t>("r");
    model.m             = tables.integer<std::uint8_t>("m");
    model.l             = tables.integer<std::uint8_t>("l");
    const std::size_t r = model.r;
    const std::size_t N = r * model.m;
    model.J0            = tables.reals("J0", r);
    model.J1            = tables.reals("J1", r);
    model.J2            = tables.reals("J2", r);
    model.Jm            = tables.reals("Jm", r);
    model.b             = tables.reals("b", N);
    model.D             = tables.reals("D", N * model.l);
    model.G             = tables.reals("G", N * plant.n);
}

const blw_l1_ops_t *engine(const JsonNode &name)
{
    static const std::map<std::string, const blw_l1_ops_t *> known = {
        {"active_set", &blw_l1_active_set_ops},
        {"admm", &blw_l1_admm_ops},
        {"newton", &blw_l1_newton_ops},
        {"tableau", &blw_l1_tableau_ops},
    };
    const auto found = known.find(name.text());
    if (found == known.end()) {
        name.fail("unknown engine '" + name.text() + "'");
    }
    return found->second;
}

void load_l1(TableReader tables, blw_l1_model_t &model)
{
    model.N              = tables.integer<std::uint16_t>("N");
    model.d              = tables.integer<std::uint16_t>("d");
    model.n_groups       = tables.integer<std::uint16_t>("n_groups");
    model.max_iterations = tables.integer<std::uint16_t>("max_iterations");
    model.n              = tables.integer<std::uint8_t>("n");
    model.engine         = engine(tables.member("engine"));
    const std::size_t N  = model.N;
    model.first          = tables.indices("first", model.n_groups + std::size_t{1U});
    model.Z              = tables.reals_or_null("Z", BLW_L1_Z_LEN(model.N, model.d));
    model.F              = tables.reals("F", model.n * N);
    model.c              = tables.reals("c", model.n_groups);
    model.M              = tables.reals_or_null("M", (N * (N + 1U)) / 2U);
    model.S              = tables.reals_or_null("S", (N * (N + 1U)) / 2U);
    model.W              = tables.reals_or_null("W", (N * (N + 1U)) / 2U);
    model.G              = tables.reals_or_null("G", N * model.n);
    const std::size_t n  = model.n;
    model.P              = tables.reals_or_null("P", (n * (n + 1U)) / 2U);
    model.rho            = tables.real("rho");
    model.kappa_G        = tables.real("kappa_G");
    model.kappa_W        = tables.real("kappa_W");
}

} // namespace

std::unique_ptr<MethodTables> load_lasso(TableReader &tables, const blw_plant_t &plant)
{
    auto loaded = std::make_unique<LassoTables>();
    load_jordan(tables.nested("jordan"), plant, loaded->jordan);
    load_l1(tables.nested("l1"), loaded->l1);
    loaded->model.jordan    = &loaded->jordan;
    loaded->model.l1        = &loaded->l1;
    const std::size_t r     = loaded->jordan.r;
    loaded->model.P         = tables.reals_or_null("P", plant.m * r * r);
    loaded->model.ambiguous = tables.integer<std::uint8_t>("ambiguous");
    return loaded;
}

} // namespace sim
