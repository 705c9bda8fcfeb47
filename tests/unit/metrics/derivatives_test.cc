#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include "unit/metrics/fields.h"

namespace sgf::metrics {
namespace {

using Jet = ceres::Jet<double, 3>;  // along intensity, gx, gy of one sample
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// epsilon of image i and of image j, and how the gradients are drawn: as in the derivation of the
// closed forms, and so weak that tau rules in sgf and sgv.
constexpr double kEpsilonI = 30, kEpsilonJ = 50;
constexpr double kStrong = 10, kWeak = 0.02;

Sample<double> SampleOf(const Vector3d& v, double epsilon) {
  return MakeSample<double>(v(0), v(1), v(2), epsilon);
}

Sample<Jet> ConstantJet(const Vector3d& v, double epsilon) {
  return MakeSample<Jet>(Jet(v(0)), Jet(v(1)), Jet(v(2)), epsilon);
}

Sample<Jet> VariableJet(const Vector3d& v, double epsilon) {
  return MakeSample<Jet>(Jet(v(0), 0), Jet(v(1), 1), Jet(v(2), 2), epsilon);
}

MatrixXd JacobianOf(const Jet& jet) { return jet.v.transpose(); }
MatrixXd JacobianOf(const Vector2<Jet>& jets) {
  Eigen::Matrix<double, 2, 3> jacobian;
  for (int k = 0; k < 2; ++k) jacobian.row(k) = jets(k).v.transpose();
  return jacobian;
}

template <int Dim>
MatrixXd JacobianOf(const SampleDerivative<double, Dim>& derivative) {
  Eigen::Matrix<double, Dim, 3> jacobian;
  jacobian.template leftCols<1>() = derivative.intensity;
  jacobian.template rightCols<2>() = derivative.gradient;
  return jacobian;
}

// Central differences of f, dim-vector, with respect to the three numbers behind a sample.
template <class F>
MatrixXd NumericJacobian(const F& f, const Vector3d& at, double step) {
  MatrixXd jacobian(f(at).size(), 3);
  for (int k = 0; k < 3; ++k) {
    const Vector3d h = step * Vector3d::Unit(k);
    jacobian.col(k) = (f(at + h) - f(at - h)) / (2 * step);
  }
  return jacobian;
}

double RelativeError(const MatrixXd& actual, const MatrixXd& expected) {
  return (actual - expected).norm() / std::max(expected.norm(), 1e-6);
}

double Quantile95(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() * 95 / 100];
}

std::vector<std::pair<Vector3d, Vector3d>> RandomPairs(int count, double strength, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  const auto draw = [&] {
    const double intensity = 128 + strength * normal(generator);
    const double gx = strength * normal(generator);
    return Vector3d(intensity, gx, strength * normal(generator));
  };
  std::vector<std::pair<Vector3d, Vector3d>> pairs;
  for (int k = 0; k < count; ++k) {
    const Vector3d i = draw();
    pairs.emplace_back(i, draw());
  }
  return pairs;
}

template <class M>
class DerivativeTest : public ::testing::Test {
 protected:
  static MatrixXd ClosedForm(const Vector3d& i, const Vector3d& j) {
    return JacobianOf(M{}.Derivative(SampleOf(i, kEpsilonI), SampleOf(j, kEpsilonJ)));
  }
  static VectorXd Residual(const Vector3d& i, const Vector3d& j) {
    return testing::AsVector(M{}(SampleOf(i, kEpsilonI), SampleOf(j, kEpsilonJ)));
  }
};

using PointMetricTypes =
    ::testing::Types<Photo, Sad, Gm, Agm, Gn, Pm, Ngf, Ugf, Sgf, Sgf2, Sgf3, Ngv, Sgv, Sgf3Vec>;
TYPED_TEST_SUITE(DerivativeTest, PointMetricTypes, testing::MetricTestName);

TYPED_TEST(DerivativeTest, EqualsAutomaticDifferentiation) {
  for (const double strength : {kStrong, kWeak})
    for (const auto& [i, j] : RandomPairs(3000, strength, 5)) {
      const auto jets = TypeParam{}(VariableJet(i, kEpsilonI), ConstantJet(j, kEpsilonJ));
      ASSERT_LT(RelativeError(this->ClosedForm(i, j), JacobianOf(jets)), 1e-10)
          << i.transpose() << " against " << j.transpose();
    }
}

// Except for the few pairs whose step crosses a kink. A difference quotient is exact up to the
// rounding of the residual over the step, which matters where the residual is close to 1 for all
// weak gradients.
TYPED_TEST(DerivativeTest, EqualsCentralDifferences) {
  for (const double strength : {kStrong, kWeak}) {
    const double step = 1e-5 * strength;
    std::vector<double> errors;
    for (const auto& [i, j] : RandomPairs(3000, strength, 6)) {
      const auto residual = [&j = j](const Vector3d& v) {
        return DerivativeTest<TypeParam>::Residual(v, j);
      };
      const MatrixXd expected = NumericJacobian(residual, i, step);
      const double rounding = 1e-15 * (1 + residual(i).norm()) / step;
      errors.push_back((this->ClosedForm(i, j) - expected).norm() /
                       (1e-6 * expected.norm() + rounding));
    }
    EXPECT_LT(Quantile95(errors), 1) << "strength " << strength;
  }
}

TYPED_TEST(DerivativeTest, IsFiniteWhereGradientsVanish) {
  const Vector3d flat(50, 0, 0), edge(90, 3, -4);
  for (const double epsilon_i : {0.0, kEpsilonI})
    for (const double epsilon_j : {0.0, kEpsilonJ})
      for (const auto& [i, j] :
           {std::pair(flat, flat), std::pair(flat, edge), std::pair(edge, flat)}) {
        const Sample<double> sample_i = SampleOf(i, epsilon_i), sample_j = SampleOf(j, epsilon_j);
        EXPECT_TRUE(testing::AsVector(TypeParam{}(sample_i, sample_j)).allFinite());
        EXPECT_TRUE(JacobianOf(TypeParam{}.Derivative(sample_i, sample_j)).allFinite());
        const auto jets = TypeParam{}(VariableJet(i, epsilon_i), ConstantJet(j, epsilon_j));
        EXPECT_TRUE(JacobianOf(jets).allFinite());
      }
}

TYPED_TEST(DerivativeTest, IsTheSameInFloat) {
  for (const auto& [i, j] : RandomPairs(200, kStrong, 7)) {
    const auto in_float = [](const Vector3d& v, double epsilon) {
      return MakeSample<float>(static_cast<float>(v(0)), static_cast<float>(v(1)),
                               static_cast<float>(v(2)), epsilon);
    };
    const auto derivative = TypeParam{}.Derivative(in_float(i, kEpsilonI), in_float(j, kEpsilonJ));
    const MatrixXd expected = this->ClosedForm(i, j);
    EXPECT_LT((derivative.gradient.template cast<double>() - expected.rightCols(2)).norm(),
              1e-4 * (1 + expected.norm()));
    EXPECT_EQ(derivative.intensity.template cast<double>(),
              expected.col(0).template cast<float>().template cast<double>());
  }
}

TEST(Derivative, IsZeroAtTheKinksOfMagnitudes) {
  const Sample<double> sample = SampleOf(Vector3d(50, 3, -4), kEpsilonI);
  EXPECT_EQ(JacobianOf(Sad{}.Derivative(sample, sample)).norm(), 0);
  EXPECT_EQ(JacobianOf(Agm{}.Derivative(sample, sample)).norm(), 0);
  EXPECT_EQ(JacobianOf(Pm{}.Derivative(sample, sample)).norm(), 0);
  const Sample<double> flat = SampleOf(Vector3d(50, 0, 0), kEpsilonI);
  EXPECT_EQ(JacobianOf(Gm{}.Derivative(flat, sample)).norm(), 0);
}

TEST(Derivative, OfPmIsZeroWhereTruncated) {
  const Sample<double> i = SampleOf(Vector3d(50, 3, -4), kEpsilonI);
  const Sample<double> j = SampleOf(Vector3d(61, 3, -3.5), kEpsilonI);
  const auto derivative = Pm{}.Derivative(i, j);
  EXPECT_EQ(derivative.intensity(0), 0);
  EXPECT_DOUBLE_EQ(derivative.gradient(1), -0.9);
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_DOUBLE_EQ((Pm{0.9, inf, inf}.Derivative(i, j).intensity(0)), -0.1);
}

template <class M>
class WindowDerivativeTest : public ::testing::Test {};
using WindowMetricTypes = ::testing::Types<Gom, Ncc, Zncc>;
TYPED_TEST_SUITE(WindowDerivativeTest, WindowMetricTypes, testing::MetricTestName);

TYPED_TEST(WindowDerivativeTest,
           EqualsAutomaticDifferentiationAndCentralDifferencesForEverySample) {
  using Span = std::span<const Sample<double>>;
  std::vector<double> errors;
  for (unsigned seed = 0; seed < 50; ++seed) {
    const auto pairs = RandomPairs(9, kStrong, seed);
    std::vector<Sample<double>> window_i, window_j;
    std::vector<Sample<Jet>> jets_i, jets_j;
    typename TypeParam::template Sums<double> sums;
    for (const auto& [i, j] : pairs) {
      window_i.push_back(SampleOf(i, kEpsilonI));
      window_j.push_back(SampleOf(j, kEpsilonJ));
      jets_i.push_back(ConstantJet(i, kEpsilonI));
      jets_j.push_back(ConstantJet(j, kEpsilonJ));
      sums.Add(window_i.back(), window_j.back());
    }
    for (size_t k = 0; k < pairs.size(); ++k) {
      const MatrixXd closed = JacobianOf(TypeParam{}.Derivative(sums, window_i[k], window_j[k]));
      auto variable = jets_i;
      variable[k] = VariableJet(pairs[k].first, kEpsilonI);
      const Jet jet =
          TypeParam{}(std::span<const Sample<Jet>>(variable), std::span<const Sample<Jet>>(jets_j));
      ASSERT_LT(RelativeError(closed, JacobianOf(jet)), 1e-8);
      const auto residual = [&](const Vector3d& v) {
        auto moved = window_i;
        moved[k] = SampleOf(v, kEpsilonI);
        return testing::AsVector(TypeParam{}(Span(moved), Span(window_j)));
      };
      errors.push_back(RelativeError(closed, NumericJacobian(residual, pairs[k].first, 1e-4)));
    }
  }
  EXPECT_LT(Quantile95(errors), 1e-5);
}

TEST(Derivative, OfLssdEqualsAutomaticDifferentiation) {
  using Jet9 = ceres::Jet<double, 9>;
  const auto pairs = RandomPairs(9, kStrong, 11);
  std::vector<Sample<double>> patch;
  std::vector<Sample<Jet9>> jets_i, jets_j;
  for (int k = 0; k < 9; ++k) {
    patch.push_back(SampleOf(pairs[k].first, kEpsilonI));
    jets_i.push_back(MakeSample<Jet9>(Jet9(pairs[k].first(0), k), Jet9(0), Jet9(0), kEpsilonI));
    jets_j.push_back(MakeSample<Jet9>(Jet9(pairs[k].second(0)), Jet9(0), Jet9(0), kEpsilonJ));
  }
  const auto residual =
      Lssd{}(std::span<const Sample<Jet9>>(jets_i), std::span<const Sample<Jet9>>(jets_j));
  const MatrixXd jacobian = Lssd{}.Jacobian(std::span<const Sample<double>>(patch));
  ASSERT_EQ(jacobian.rows(), 9);
  for (int k = 0; k < 9; ++k)
    EXPECT_LT((jacobian.row(k) - residual(k).v.transpose()).norm(), 1e-15);
}

}  // namespace
}  // namespace sgf::metrics
