#include <concepts>

#include <gtest/gtest.h>

#include "unit/metrics/fields.h"

namespace sgf::metrics {
namespace {

using testing::Field;
using testing::RandomTexture;

// Everything below is computed in double on intensities of some 1e2 with differences of some 1e1,
// so rounding stays below 1e-12 of the terms; the sums of windows and tau's 1e4 leave it below
// 1e-9.
constexpr double kRounding = 1e-9;
// A trait that does not hold is off by far more than that on a random texture.
constexpr double kClearly = 1e-2;

double LargestDifference(const std::vector<Eigen::VectorXd>& a,
                         const std::vector<Eigen::VectorXd>& b) {
  double largest = 0;
  for (size_t k = 0; k < a.size(); ++k)
    largest = std::max(largest, (a[k] - b[k]).cwiseAbs().maxCoeff() / (1 + a[k].norm()));
  return largest;
}

template <class M>
concept HasDerivative = requires(M metric, Sample<double> s) {
  metric.Derivative(s, s);
}
|| requires(M metric, typename M::template Sums<double> sums, Sample<double> s) {
  metric.Derivative(sums, s, s);
}
|| requires(M metric, std::span<const Sample<double>> patch) { metric.Jacobian(patch); };

template <class M>
class MetricTraitsTest : public ::testing::Test {
 protected:
  static constexpr MetricTraits kTraits = M::kInfo.traits;

  // How much the residuals move when one of the images alone is mapped to gain * I + offset.
  double ChangeUnder(double gain, double offset) const {
    const auto before = testing::Residuals<M>(i_, j_);
    const Field changed_i(gain * i_.intensity + offset), changed_j(gain * j_.intensity + offset);
    return std::max(LargestDifference(before, testing::Residuals<M>(changed_i, j_)),
                    LargestDifference(before, testing::Residuals<M>(i_, changed_j)));
  }

  Field i_{RandomTexture(24, 30, 1)}, j_{RandomTexture(24, 30, 2)};
};

TYPED_TEST_SUITE(MetricTraitsTest, testing::AllMetricTestTypes, testing::MetricTestName);

TYPED_TEST(MetricTraitsTest, IsCalledAsItsKindSays) {
  using S = Sample<double>;
  using Window = std::span<const S>;
  constexpr MetricKind kKind = TypeParam::kInfo.traits.kind;
  EXPECT_EQ(kKind == MetricKind::kPoint, (std::invocable<TypeParam, S, S>));
  EXPECT_EQ(kKind == MetricKind::kWindow || kKind == MetricKind::kPatch,
            (std::invocable<TypeParam, Window, Window>));
  EXPECT_EQ(kKind == MetricKind::kSignature, (std::invocable<TypeParam, uint64_t, uint64_t>));
  EXPECT_EQ(this->kTraits.windowed(), (!std::invocable<TypeParam, S, S>));
}

TYPED_TEST(MetricTraitsTest, ResidualIsOfItsKindAndDimension) {
  double lowest = 0, highest = 0;
  for (const Eigen::VectorXd& e : testing::Residuals<TypeParam>(this->i_, this->j_)) {
    if (TypeParam::kDim != Eigen::Dynamic) {
      EXPECT_EQ(e.size(), TypeParam::kDim);
    }
    EXPECT_EQ(e.size() > 1, this->kTraits.residual == ResidualKind::kVector);
    lowest = std::min(lowest, e.minCoeff());
    highest = std::max(highest, e.maxCoeff());
  }
  EXPECT_GT(highest, kClearly);
  if (this->kTraits.residual == ResidualKind::kNonNegative) {
    EXPECT_GE(lowest, -kRounding);
  } else {
    EXPECT_LT(lowest, -kClearly);
  }
}

TYPED_TEST(MetricTraitsTest, IsZeroAtEqualityOrNot) {
  double largest = 0;
  const auto residuals = testing::Residuals<TypeParam>(this->i_, this->i_);
  for (size_t k = 0; k < residuals.size(); ++k) {
    const Sample<double>& sample = this->i_.samples[k];
    if (!this->kTraits.windowed() && sample.ax * sample.ax + sample.ay * sample.ay < kTau) continue;
    largest = std::max(largest, residuals[k].cwiseAbs().maxCoeff());
  }
  if (this->kTraits.zero_at_equality) {
    EXPECT_LT(largest, kRounding);
  } else {
    EXPECT_GT(largest, kClearly);
  }
}

TYPED_TEST(MetricTraitsTest, IsSymmetricOrAntisymmetric) {
  const auto forward = testing::Residuals<TypeParam>(this->i_, this->j_);
  auto backward = testing::Residuals<TypeParam>(this->j_, this->i_);
  const double asymmetry = LargestDifference(forward, backward);
  if (this->kTraits.symmetric) {
    EXPECT_LT(asymmetry, kRounding);
  } else {
    EXPECT_GT(asymmetry, kClearly);
    for (Eigen::VectorXd& e : backward) e = -e;
    EXPECT_LT(LargestDifference(forward, backward), kRounding);
  }
}

TYPED_TEST(MetricTraitsTest, IsInvariantToGainOrNot) {
  for (const double gain : {0.6, 1.7}) {
    if (this->kTraits.gain_invariant) {
      EXPECT_LT(this->ChangeUnder(gain, 0), kRounding) << gain;
    } else {
      EXPECT_GT(this->ChangeUnder(gain, 0), kClearly) << gain;
    }
  }
}

TYPED_TEST(MetricTraitsTest, IsInvariantToOffsetOrNot) {
  for (const double offset : {20.0, -13.0}) {
    if (this->kTraits.offset_invariant) {
      EXPECT_LT(this->ChangeUnder(1, offset), kRounding) << offset;
    } else {
      EXPECT_GT(this->ChangeUnder(1, offset), kClearly) << offset;
    }
  }
}

TYPED_TEST(MetricTraitsTest, HasADerivativeOrNot) {
  EXPECT_EQ(HasDerivative<TypeParam>, this->kTraits.differentiable);
}

}  // namespace
}  // namespace sgf::metrics
