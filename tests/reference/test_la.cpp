// SPDX-License-Identifier: MIT
// Every kernel of blw_la against Eigen in double, for all sizes 1..8.
#include <Eigen/Dense>
#include <limits>
#include <random>
#include <vector>
#include "check.hpp"
extern "C" {
#include "blw_la.h"
}

namespace
{

using Reals  = std::vector<blw_real_t>;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Vector = Eigen::VectorXd;

constexpr double      tolerance = 32.0 * static_cast<double>(BLW_REAL_EPS);
constexpr std::size_t largest   = 8;
constexpr blw_real_t  untouched = 77;

std::mt19937 generator(20240229);

Reals draw(std::size_t len)
{
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    Reals                                  numbers(len);
    for (auto &number : numbers) {
        number = static_cast<blw_real_t>(uniform(generator));
    }
    return numbers;
}

Matrix dense(const Reals &a, std::size_t rows, std::size_t cols)
{
    Matrix matrix(rows, cols);
    for (std::size_t i = 0; i < rows * cols; ++i) {
        matrix(static_cast<Eigen::Index>(i / cols), static_cast<Eigen::Index>(i % cols)) = a[i];
    }
    return matrix;
}

Vector column(const Reals &a, std::size_t len)
{
    return dense(a, len, 1);
}

// The trapezoid [rows x cols] of a packed table, unpacked by counting along its rows.
Matrix trapezoid(const Reals &packed, std::size_t rows, std::size_t cols)
{
    Matrix matrix = Matrix::Zero(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(cols));
    std::size_t next = 0;
    for (std::size_t i = 0; i < rows; ++i) {
        for (std::size_t j = 0; j <= i && j < cols; ++j) {
            matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = packed[next++];
        }
    }
    return matrix;
}

// actual starts with expected and goes on with what was there before.
void check_vector(const Vector &expected, const Reals &actual)
{
    for (Eigen::Index i = 0; i < expected.size(); ++i) {
        CHECK_NEAR(expected(i), static_cast<double>(actual[static_cast<std::size_t>(i)]),
                   tolerance);
    }
    CHECK(actual.back() == untouched);
}

void scalars()
{
    const blw_real_t nan = std::numeric_limits<blw_real_t>::quiet_NaN();
    CHECK(blw_la_abs(-2) == 2);
    CHECK(blw_la_abs(3) == 3);
    CHECK(std::isnan(blw_la_abs(nan)));
    CHECK(blw_la_max(1, 2) == 2);
    CHECK(blw_la_max(2, 1) == 2);
    CHECK(blw_la_max(1, nan) == 1);
    CHECK(std::isnan(blw_la_max(nan, 1)));
    CHECK(blw_la_sqrt(2) == std::sqrt(static_cast<blw_real_t>(2)));
    CHECK(blw_la_packed_row(0) == 0);
    CHECK(blw_la_packed_row(4) == 10);
    CHECK(blw_la_trap_row(3, 2) == 3);
    CHECK(blw_la_trap_row(3, 3) == 6);
    CHECK(blw_la_trap_row(3, 5) == 12);
}

void bounds(std::size_t n)
{
    const blw_real_t max = BLW_REAL_MAX;
    const blw_real_t inf = std::numeric_limits<blw_real_t>::infinity();
    const blw_real_t nan = std::numeric_limits<blw_real_t>::quiet_NaN();
    for (std::size_t i = 0; i < n; ++i) {
        Reals x = draw(n);
        CHECK(blw_la_finite(n, x.data()) && blw_la_bounded(n, x.data()));
        x[i] = -BLW_SIGNAL_MAX;
        CHECK(blw_la_finite(n, x.data()) && blw_la_bounded(n, x.data()));
        for (const blw_real_t large : {2 * BLW_SIGNAL_MAX, -max}) {
            x[i] = large;
            CHECK(blw_la_finite(n, x.data()) && !blw_la_bounded(n, x.data()));
        }
        for (const blw_real_t bad : {inf, -inf, nan}) {
            x[i] = bad;
            CHECK(!blw_la_finite(n, x.data()) && !blw_la_bounded(n, x.data()));
        }
    }
    CHECK(blw_la_finite(0, nullptr) && blw_la_bounded(0, nullptr));
}

void vectors(std::size_t n)
{
    const Reals      a     = draw(n);
    const Reals      b     = draw(n);
    const Vector     ea    = column(a, n);
    const Vector     eb    = column(b, n);
    const blw_real_t alpha = draw(1)[0];

    CHECK_NEAR(ea.dot(eb), static_cast<double>(blw_la_dot(n, a.data(), b.data())), tolerance);
    CHECK_NEAR(ea.norm(), static_cast<double>(blw_la_norm(n, a.data())), tolerance);

    Reals y = b;
    y.push_back(untouched);
    blw_la_axpy(n, alpha, a.data(), y.data());
    check_vector(eb + static_cast<double>(alpha) * ea, y);
    blw_la_copy(n, a.data(), y.data());
    check_vector(ea, y);
    blw_la_fill(n, alpha, y.data());
    check_vector(Vector::Constant(static_cast<Eigen::Index>(n), alpha), y);
    blw_la_sum(n, a.data(), b.data(), y.data());
    check_vector(ea + eb, y);
    blw_la_zero(n, y.data());
    check_vector(Vector::Zero(static_cast<Eigen::Index>(n)), y);
}

void products(std::size_t rows, std::size_t cols)
{
    const Reals  A      = draw(rows * cols);
    const Reals  x      = draw(cols);
    const Vector Ax     = dense(A, rows, cols) * column(x, cols);
    Reals        y      = draw(rows);
    const Vector before = column(y, rows);

    y.push_back(untouched);
    blw_la_gemv_add(rows, cols, A.data(), x.data(), y.data());
    check_vector(before + Ax, y);
    blw_la_gemv(rows, cols, A.data(), x.data(), y.data());
    check_vector(Ax, y);
}

void symmetric_products(std::size_t n)
{
    const Reals  S     = draw(n * (n + 1) / 2);
    const Reals  x     = draw(n);
    const Matrix lower = trapezoid(S, n, n);
    const Matrix full  = lower.selfadjointView<Eigen::Lower>();
    Reals        y(n + 1, untouched);

    blw_la_symv(n, S.data(), x.data(), y.data());
    check_vector(full * column(x, n), y);
}

void trapezoid_products(std::size_t rows, std::size_t cols)
{
    const Reals  Z  = draw((cols * (cols + 1) / 2) + ((rows - cols) * cols));
    const Matrix eZ = trapezoid(Z, rows, cols);
    const Reals  x  = draw(cols);
    Reals        y(rows + 1, untouched);

    blw_la_trapv(rows, cols, Z.data(), x.data(), y.data());
    check_vector(eZ * column(x, cols), y);

    const Reals v = draw(rows);
    Reals       w(cols + 1, untouched);
    blw_la_trapv_t(rows, cols, Z.data(), v.data(), w.data());
    check_vector(eZ.transpose() * column(v, rows), w);
}

void triangular_solves(std::size_t n)
{
    Reals L = draw(n * (n + 1) / 2);
    for (std::size_t i = 0; i < n; ++i) {
        L[blw_la_packed_row(i) + i] += 3; // well conditioned
    }
    const Matrix eL = trapezoid(L, n, n);
    const Reals  b  = draw(n);
    const Vector eb = column(b, n);
    Reals        x  = b;

    x.push_back(untouched);
    blw_la_solve_lower(n, L.data(), x.data());
    check_vector(eL.triangularView<Eigen::Lower>().solve(eb), x);
    x.assign(b.begin(), b.end());
    x.push_back(untouched);
    blw_la_solve_lower_t(n, L.data(), x.data());
    check_vector(eL.transpose().triangularView<Eigen::Upper>().solve(eb), x);
}

void slices()
{
    blw_real_t  memory[5] = {};
    blw_real_t *rest      = memory;
    CHECK(blw_la_take(&rest, 2) == &memory[0]);
    CHECK(blw_la_take(&rest, 0) == &memory[2]);
    CHECK(blw_la_take(&rest, 3) == &memory[2]);
    CHECK(rest == &memory[5]);
}

} // namespace

int main()
{
    scalars();
    slices();
    for (std::size_t n = 1; n <= largest; ++n) {
        bounds(n);
        vectors(n);
        symmetric_products(n);
        triangular_solves(n);
        for (std::size_t cols = 1; cols <= largest; ++cols) {
            products(n, cols);
        }
        for (std::size_t cols = 1; cols <= n; ++cols) {
            trapezoid_products(n, cols);
        }
    }
    return (check::failures == 0) ? 0 : 1;
}
