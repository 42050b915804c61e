// SPDX-License-Identifier: MIT
// Random instances of the l1 fusion, reduced with Eigen, and an independent ADMM for them.
#ifndef RANDOM_L1_H
#define RANDOM_L1_H
#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <vector>

#include "blw/blw_l1.h"

namespace reference
{

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

// Every kind of expression compiles a kernel of its own, and for seconds: these few are enough.
inline Vector applied(const Matrix &A, const Vector &x)
{
    return A * x;
}

inline Matrix times(const Matrix &A, const Matrix &B)
{
    return A * B;
}

inline Matrix transposed(const Matrix &A)
{
    return A.transpose();
}

inline Matrix inverse(const Matrix &A)
{
    return A.inverse();
}

// diag(s) A
inline Matrix scaled(const Vector &s, const Matrix &A)
{
    return s.asDiagonal() * A;
}

inline Matrix square(const Matrix &A)
{
    return times(A, transposed(A));
}

// The tables of one instance of (1) in blw_l1.h, in double and as the library takes them.
class Problem
{
public:
    // sizes: rows of every group, 1 or 2; n states; least eigenvalue of W before scaling.
    Problem(unsigned seed, const std::vector<int> &sizes, int n, double threshold,
            double least = 0.02)
        : random_(seed), N_(0), n_(n), c_(static_cast<Eigen::Index>(sizes.size()))
    {
        first_.push_back(0);
        for (const int size : sizes) {
            N_ += size;
            first_.push_back(static_cast<uint16_t>(N_));
        }
        G_             = normal(N_, n);
        const Matrix X = normal(N_, N_);
        W_             = square(X) / N_;
        W_.diagonal().array() += least;
        reduce();
        for (Eigen::Index g = 0; g < c_.size(); ++g) {
            c_(g) = threshold * (1.0 + 0.3 * std::abs(normal(1, 1)(0)));
        }
        convert();
    }

    // Every state seen alike by N / n groups of one row, with equal thresholds: for an even number
    // of them there are many minimisers.
    void make_degenerate(double threshold)
    {
        for (int i = 0; i < N_; ++i) {
            G_.row(i) = Matrix::Identity(n_, n_).row(i % n_);
        }
        const Matrix own = W_.topLeftCorner(n_, n_);
        W_.setZero();
        for (int i = 0; i + n_ <= N_; i += n_) {
            W_.block(i, i, n_, n_) = own;
        }
        reduce();
        c_.setConstant(threshold);
        convert();
    }

    Matrix normal(Eigen::Index rows, Eigen::Index cols)
    {
        std::normal_distribution<double> distribution;
        return Matrix::NullaryExpr(rows, cols, [&] { return distribution(random_); });
    }

    // G x + benign noise + attack on the groups of one part of the rows.
    Vector sample(double attack)
    {
        const Eigen::LLT<Matrix> W(W_);
        Vector                   zeta = applied(G_, normal(n_, 1));
        zeta += applied(W.matrixL(), normal(N_, 1));
        zeta.head(N_ / 4) += attack * normal(N_ / 4, 1);
        return zeta;
    }

    // (2) by ADMM in double, started cold: an algorithm and a linear algebra of its own.
    Vector solve(const Vector &zeta, int passes) const
    {
        const double rho = 0.3;
        const Matrix M   = regularised_inverse(rho);
        const Vector Sz  = applied(square(Z_), zeta);
        Vector       t   = Vector::Zero(N_);
        Vector       u   = Vector::Zero(N_);
        for (int pass = 0; pass < passes; ++pass) {
            const Vector nu = applied(M, Sz + rho * (t - u));
            const Vector v  = 1.6 * nu - 0.6 * t + u;
            for (Eigen::Index g = 0; g < c_.size(); ++g) {
                const auto   rows = v.segment(first(g), size(g));
                const double keep =
                    std::max(0.0, 1.0 - c_(g) / rho / std::max(rows.norm(), 1e-300));
                t.segment(first(g), size(g)) = keep * rows;
            }
            u = v - t;
        }
        return applied(F_, zeta - t);
    }

    // Largest violation of the optimality conditions (4), relative to c_g, for nu = zeta - tau.
    double violation(const Vector &zeta, const Vector &tau) const
    {
        const Vector nu    = zeta - tau;
        const Vector l     = applied(square(Z_), tau);
        double       worst = 0.0;
        for (Eigen::Index g = 0; g < c_.size(); ++g) {
            const Vector l_g  = l.segment(first(g), size(g));
            const Vector nu_g = nu.segment(first(g), size(g));
            worst             = std::max(worst, (l_g.norm() - c_(g)) / c_(g));
            if (nu_g.norm() > 0.0) {
                worst = std::max(worst, (l_g - c_(g) * nu_g.normalized()).norm() / c_(g));
            }
        }
        return worst;
    }

    // The objective (2) at nu = zeta - tau.
    double objective(const Vector &zeta, const Vector &tau) const
    {
        const Vector nu  = zeta - tau;
        double       sum = 0.5 * applied(transposed(Z_), tau).squaredNorm();
        for (Eigen::Index g = 0; g < c_.size(); ++g) {
            sum += c_(g) * nu.segment(first(g), size(g)).norm();
        }
        return sum;
    }

    blw_l1_model_t model(const blw_l1_ops_t *engine, int max_iterations) const
    {
        blw_l1_model_t m{};
        m.N              = static_cast<uint16_t>(N_);
        m.d              = static_cast<uint16_t>(N_ - n_);
        m.n_groups       = static_cast<uint16_t>(c_.size());
        m.max_iterations = static_cast<uint16_t>(max_iterations);
        m.n              = static_cast<uint8_t>(n_);
        m.engine         = engine;
        m.first          = first_.data();
        m.Z              = Z_table_.data();
        m.F              = F_table_.data();
        m.c              = c_table_.data();
        m.M              = M_of(engine);
        if ((engine == &blw_l1_tableau_ops) || (engine == &blw_l1_newton_ops)) {
            m.Z = nullptr;
            m.S = S_table_.data();
            m.W = W_table_.data();
            m.G = G_table_.data();
            m.P = P_table_.data();
        }
        m.rho     = (m.M != nullptr) ? BLW_R(0.3) : BLW_R(0.0);
        m.kappa_G = static_cast<blw_real_t>(kappa_G_);
        m.kappa_W = static_cast<blw_real_t>(kappa_W_);
        return m;
    }

    int rows() const
    {
        return N_;
    }
    int states() const
    {
        return n_;
    }
    Vector kalman(const Vector &zeta) const
    {
        return applied(F_, zeta);
    }

private:
    const blw_real_t *M_of(const blw_l1_ops_t *engine) const
    {
        if (engine == &blw_l1_newton_ops) {
            return smoothed_table_.data();
        }
        return (engine == &blw_l1_admm_ops) ? M_table_.data() : nullptr;
    }

    // From zeta to l where nu_g = D l_g for all groups: see blw_l1_newton_start.c.
    Matrix smoothed() const
    {
        Matrix K = W_;
        for (Eigen::Index g = 0; g < c_.size(); ++g) {
            const double width = std::sqrt(W_(first(g), first(g)));
            K.diagonal().segment(first(g), size(g)).array() += 0.3 * width / c_(g);
        }
        K               = inverse(K);
        const Matrix KG = times(K, G_);
        return K - times(KG, times(inverse(times(transposed(G_), KG)), transposed(KG)));
    }

    // (S + rho I)^-1
    Matrix regularised_inverse(double rho) const
    {
        Matrix S = square(Z_);
        S.diagonal().array() += rho;
        return inverse(S);
    }

    Eigen::Index first(Eigen::Index g) const
    {
        return first_[static_cast<size_t>(g)];
    }
    Eigen::Index size(Eigen::Index g) const
    {
        return first_[static_cast<size_t>(g) + 1] - first(g);
    }

    // Z, F for rows scaled so that Z Z' has unit mean square over every group.
    void reduce()
    {
        const Matrix Winv = inverse(W_);
        const Matrix WG   = times(Winv, G_);
        const Matrix P    = inverse(times(transposed(G_), WG));
        const Matrix S    = Winv - times(WG, times(P, transposed(WG)));
        Vector       s(N_);
        for (Eigen::Index g = 0; g < c_.size(); ++g) {
            const double trace = S.diagonal().segment(first(g), size(g)).sum();
            s.segment(first(g), size(g)).setConstant(std::sqrt(trace / double(size(g))));
        }
        const Eigen::SelfAdjointEigenSolver<Matrix> eigen(S);
        const int                                   d       = N_ - n_;
        const Matrix                                vectors = eigen.eigenvectors().rightCols(d);
        const Vector                                roots = eigen.eigenvalues().tail(d).cwiseSqrt();
        const Matrix                                root =
            scaled(s.cwiseInverse(), transposed(scaled(roots, transposed(vectors))));
        const Eigen::HouseholderQR<Matrix> qr(Matrix(transposed(root.topRows(d))));
        Z_ = times(root, Matrix(qr.householderQ()));
        G_ = scaled(s, G_);
        W_ = scaled(s, transposed(scaled(s, W_)));
        F_ = times(P, times(transposed(G_), inverse(W_)));
    }

    // Lower triangle, packed by rows.
    static std::vector<blw_real_t> lower(const Matrix &M)
    {
        std::vector<blw_real_t> packed;
        for (Eigen::Index i = 0; i < M.rows(); ++i) {
            for (Eigen::Index j = 0; j <= i; ++j) {
                packed.push_back(static_cast<blw_real_t>(M(i, j)));
            }
        }
        return packed;
    }

    void convert()
    {
        const int d = N_ - n_;
        for (auto *table : {&Z_table_, &F_table_, &c_table_, &M_table_}) {
            table->clear();
        }
        for (int i = 0; i < N_; ++i) {
            for (int j = 0; j < std::min(i + 1, d); ++j) {
                Z_table_.push_back(static_cast<blw_real_t>(Z_(i, j)));
            }
        }
        const Matrix M = regularised_inverse(0.3);
        for (int i = 0; i < N_; ++i) {
            for (int j = 0; j <= i; ++j) {
                M_table_.push_back(static_cast<blw_real_t>(M(i, j)));
            }
        }
        for (int i = 0; i < n_; ++i) {
            for (int j = 0; j < N_; ++j) {
                F_table_.push_back(static_cast<blw_real_t>(F_(i, j)));
            }
        }
        for (int i = 0; i < N_; ++i) {
            for (int j = 0; j < n_; ++j) {
                G_table_.push_back(static_cast<blw_real_t>(G_(i, j)));
            }
        }
        S_table_        = lower(square(Z_));
        smoothed_table_ = lower(smoothed());
        W_table_        = lower(W_);
        P_table_        = lower(times(F_, times(W_, transposed(F_))));
        Vector rows_c(N_);
        for (Eigen::Index g = 0; g < c_.size(); ++g) {
            c_table_.push_back(static_cast<blw_real_t>(c_(g)));
            rows_c.segment(first(g), size(g)).setConstant(c_(g));
        }
        const Matrix cG  = transposed(scaled(rows_c, G_));
        const Matrix cWZ = transposed(scaled(rows_c, times(W_, Z_)));

        const Eigen::SelfAdjointEigenSolver<Matrix> squares_G(square(cG));
        const Eigen::SelfAdjointEigenSolver<Matrix> squares_W(square(cWZ));
        kappa_G_ = 1.0 / std::sqrt(squares_G.eigenvalues().minCoeff());
        kappa_W_ = std::sqrt(double(c_.size()) * squares_W.eigenvalues().maxCoeff());
    }

    std::mt19937            random_;
    int                     N_;
    int                     n_;
    Vector                  c_;
    std::vector<uint16_t>   first_;
    Matrix                  G_, W_, Z_, F_;
    std::vector<blw_real_t> Z_table_, F_table_, c_table_, M_table_;
    std::vector<blw_real_t> S_table_, W_table_, G_table_, P_table_, smoothed_table_;
    double                  kappa_G_ = 0.0;
    double                  kappa_W_ = 0.0;
};

} // namespace reference
#endif
