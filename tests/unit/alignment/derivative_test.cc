#include <ceres/jet.h>
#include <gtest/gtest.h>
#include <unit/alignment/analytic_image.h>
#include <unit/alignment/derivative_check.h>

// Derivatives of every residual by the parameters of every warp: closed forms against differences
// and against automatic differentiation, which shares with them only the dissimilarities' values.

namespace sgf::alignment {
namespace {

const Camera kCamera = CameraFor(400, 300);

template <class Residual>
auto AnalyticImageFor(const Residual&) {
  if constexpr (kOfSamples<Residual>)
    return AnalyticImage{};
  else
    return AnalyticPlanes{};
}

TYPED_TEST(WarpTest, DerivativesAgreeWithDifferencesOnAnAnalyticImage) {
  ForEachResidual([](const auto& residual) {
    ExpectAgreementWithDifferences<TypeParam>(residual, AnalyticImageFor(residual), kCamera);
  });
}

// --- Where warps find pixels, written down anew ---

// Twice differentiable: along the pixel of the reference, and along all parameters within.
template <class Jet>
using TwiceJet = ceres::Jet<Jet, 2>;

template <class T>
T Constant(double value) {
  return T(typename T::Scalar(value));
}

// A warp's place after a change of its parameters, for a pixel of the reference moved by du.
template <class T>
Vector2<T> Place(const TranslationWarp<double>& warp, const Vector2<double>& offset,
                 const std::vector<T>& change, const Vector2<T>& du) {
  return {Constant<T>(warp.centre.x() + offset.x()) + change[0] + du.x(),
          Constant<T>(warp.centre.y() + offset.y()) + change[1] + du.y()};
}

template <class T, bool kScaled>
Vector2<T> Place(const PlanarWarp<double, kScaled>& warp, const Vector2<double>& offset,
                 const std::vector<T>& change, const Vector2<T>& du) {
  const T x = Constant<T>(offset.x()) + du.x(), y = Constant<T>(offset.y()) + du.y();
  const T angle = Constant<T>(warp.angle) + change[2];
  T scale = Constant<T>(1);
  if constexpr (kScaled) scale = exp(Constant<T>(warp.log_scale) + change[3]);
  return {Constant<T>(warp.centre.x()) + change[0] + scale * (cos(angle) * x - sin(angle) * y),
          Constant<T>(warp.centre.y()) + change[1] + scale * (sin(angle) * x + cos(angle) * y)};
}

// R ray + inverse_depth p of a pixel of a slanted surface.
template <class T>
Vector3<T> MovedPoint(const SE3& motion, const PixelAtDepth<double>& u, const T& inverse_depth,
                      const Vector2<T>& du) {
  const T depth =
      inverse_depth + Constant<T>(u.slope.x()) * du.x() + Constant<T>(u.slope.y()) * du.y();
  const T x = Constant<T>(u.ray.x()) + du.x() / Constant<T>(kCamera.fx);
  const T y = Constant<T>(u.ray.y()) + du.y() / Constant<T>(kCamera.fy);
  const Eigen::Matrix3d R = motion.R.toRotationMatrix();
  Vector3<T> point;
  for (int k = 0; k < 3; ++k)
    point(k) = Constant<T>(R(k, 0)) * x + Constant<T>(R(k, 1)) * y + Constant<T>(R(k, 2)) +
               depth * Constant<T>(motion.p(k));
  return point;
}

template <class T>
Vector2<T> Project(const Vector3<T>& X) {
  return {Constant<T>(kCamera.fx) * X.x() / X.z() + Constant<T>(kCamera.cx),
          Constant<T>(kCamera.fy) * X.y() / X.z() + Constant<T>(kCamera.cy)};
}

template <class T>
Vector2<T> Place(const Se3Warp<double>& warp, const PixelAtDepth<double>& u,
                 const std::vector<T>& change, const Vector2<T>& du) {
  const T inverse_depth = Constant<T>(u.inverse_depth) + Constant<T>(u.slope.x()) * du.x() +
                          Constant<T>(u.slope.y()) * du.y();
  const Vector3<T> X = MovedPoint(warp.T_cur_ref, u, Constant<T>(u.inverse_depth), du);
  const Vector3<T> v(change[0], change[1], change[2]), w(change[3], change[4], change[5]);
  // exp(w) X to first order, which is all that a derivative at w = 0 takes.
  return Project<T>(X + w.cross(X) + v * inverse_depth);
}

template <class T>
Vector2<T> Place(const EpipolarWarp<double>& warp, const PixelAtDepth<double>& u,
                 const std::vector<T>& change, const Vector2<T>& du) {
  const SE3 motion{Eigen::Quaterniond(warp.projector.R), warp.projector.p};
  return Project<T>(
      MovedPoint(motion, u, Constant<T>(warp.inverse_depth + u.inverse_depth) + change[0], du));
}

// The pixel of the reference stays, its ray follows the camera.
template <class T>
Vector2<T> Place(const WindowWarp& warp, const PixelAtDepth<double>& u,
                 const std::vector<T>& change, const Vector2<T>& du) {
  const Camera &c = warp.camera, &o = warp.of_rays;
  const T fx = Constant<T>(c.fx) + change[7], fy = Constant<T>(c.fy) + change[8];
  const T cx = Constant<T>(c.cx) + change[9], cy = Constant<T>(c.cy) + change[10];
  const T x = (Constant<T>(u.ray.x() * o.fx + o.cx) + du.x() - cx) / fx;
  const T y = (Constant<T>(u.ray.y() * o.fy + o.cy) + du.y() - cy) / fy;
  const T inverse_depth = Constant<T>(warp.moved.inverse_depth + u.inverse_depth) + change[6] +
                          Constant<T>(u.slope.x()) * du.x() + Constant<T>(u.slope.y()) * du.y();
  const SE3& motion = warp.moved.motion.T_cur_ref;
  const Eigen::Matrix3d R = motion.R.toRotationMatrix();
  Vector3<T> X;
  for (int k = 0; k < 3; ++k)
    X(k) = Constant<T>(R(k, 0)) * x + Constant<T>(R(k, 1)) * y + Constant<T>(R(k, 2)) +
           inverse_depth * Constant<T>(motion.p(k));
  const Vector3<T> v(change[0], change[1], change[2]), w(change[3], change[4], change[5]);
  const Vector3<T> moved = X + w.cross(X) + v * inverse_depth;
  return {fx * moved.x() / moved.z() + cx, fy * moved.y() / moved.z() + cy};
}

// A pixel of the current image as a function of the parameters.
template <class Jet>
struct JetPixel {
  Vector2<Jet> place;
  Eigen::Matrix<Jet, 2, 2> A;  // its derivative by the pixel of the reference
};

template <class Jet, class Warp>
JetPixel<Jet> FindPixel(const Warp& warp, const typename Warp::Input& input) {
  using T = TwiceJet<Jet>;
  std::vector<T> change;
  for (int k = 0; k < Warp::kParameters; ++k) change.emplace_back(Jet(0, k));
  const Vector2<T> found = Place<T>(warp, input, change, {T(Jet(0), 0), T(Jet(0), 1)});
  JetPixel<Jet> pixel;
  for (int k = 0; k < 2; ++k) {
    pixel.place(k) = found(k).a;
    pixel.A.row(k) = found(k).v.transpose();
  }
  return pixel;
}

// --- Residuals of a patch as functions of the parameters ---

template <class Jet>
metrics::Sample<Jet> AsJets(const metrics::Sample<double>& s) {
  return {Jet(s.intensity), Jet(s.gx), Jet(s.gy), Jet(s.norm),
          Jet(s.reg_norm),  Jet(s.ax), Jet(s.ay), Jet(s.r)};
}

template <class Jet>
std::vector<Jet> Components(const Jet& scalar) {
  return {scalar};
}
template <class Jet>
std::vector<Jet> Components(const Vector2<Jet>& vector) {
  return {vector.x(), vector.y()};
}

template <class Jet, class Metric>
std::vector<Jet> Compare(const PointResidual<Metric>& residual, const JetPixel<Jet>& pixel,
                         const metrics::Sample<double>& reference) {
  const auto channels = AnalyticImage{}.Sample(pixel.place).value;
  const Vector2<Jet> g = pixel.A.transpose() * GradientOf(channels);
  const double epsilon = channels[kEpsilon].a * pixel.A.squaredNorm().a / 2;
  const auto current = metrics::MakeSample<Jet>(channels[kIntensity], g.x(), g.y(), epsilon);
  return Components<Jet>(residual.metric(current, AsJets<Jet>(reference)));
}

template <class Jet>
std::vector<Jet> Compare(const AffinePhotoResidual& residual, const JetPixel<Jet>& pixel,
                         double reference) {
  const Jet intensity = AnalyticImage{}.Sample(pixel.place).value[kIntensity];
  const Jet alpha(residual.alpha, Jet::DIMENSION - 2), beta(residual.beta, Jet::DIMENSION - 1);
  return {exp(alpha) * intensity + beta - reference};
}

template <class Jet>
std::vector<Jet> Compare(const BitPlanesResidual&, const JetPixel<Jet>& pixel,
                         const Eigen::Array<double, 8, 1>& reference) {
  const auto channels = AnalyticPlanes{}.Sample(pixel.place).value;
  std::vector<Jet> differences;
  for (int k = 0; k < 8; ++k) differences.push_back(channels[k] - reference[k]);
  return differences;
}

template <class Jet, class Residual, class Warp>
std::vector<Jet> JetResiduals(const Residual& residual, const Warp& warp,
                              const Patch<Residual, Warp>& patch) {
  std::vector<Jet> residuals;
  for (size_t k = 0; k < patch.size; ++k)
    for (const Jet& r :
         Compare(residual, FindPixel<Jet>(warp, patch.inputs[k]), patch.references[k]))
      residuals.push_back(r);
  return residuals;
}

template <class Jet, class Warp>
std::vector<Jet> JetResiduals(const LssdResidual&, const Warp& warp,
                              const Patch<LssdResidual, Warp>& patch) {
  std::vector<metrics::Sample<Jet>> current, reference;
  for (size_t k = 0; k < patch.size; ++k) {
    const Vector2<Jet> place = FindPixel<Jet>(warp, patch.inputs[k]).place;
    current.push_back(LssdResidual::MakeReference(AnalyticImage{}.Sample(place)));
    reference.push_back(AsJets<Jet>(patch.references[k]));
  }
  const auto r = metrics::Lssd{}(std::span<const metrics::Sample<Jet>>(current),
                                 std::span<const metrics::Sample<Jet>>(reference));
  return {r.begin(), r.end()};
}

template <class Residual, class Warp>
Eigen::MatrixXd AutomaticJacobian(const Residual& residual, const Warp& warp,
                                  const Patch<Residual, Warp>& patch) {
  constexpr int P = kAllParameters<Residual, Warp>;
  const auto residuals = JetResiduals<ceres::Jet<double, P>>(residual, warp, patch);
  Eigen::MatrixXd jacobian(residuals.size(), P);
  for (size_t k = 0; k < residuals.size(); ++k) jacobian.row(k) = residuals[k].v.transpose();
  return jacobian;
}

TYPED_TEST(WarpTest, DerivativesAgreeWithAutomaticDifferentiation) {
  ForEachResidual([](const auto& residual) {
    const auto image = AnalyticImageFor(residual);
    ForSomePatches<TypeParam>(residual, image, kCamera, [&](const auto& warp, const auto& patch) {
      const Eigen::MatrixXd expected = AutomaticJacobian(residual, warp, patch);
      const Eigen::MatrixXd actual = Jacobian(residual, image, warp, patch);
      ASSERT_EQ(actual.rows(), expected.rows());
      EXPECT_LE((actual - expected).norm(), 1e-10 * expected.norm());
    });
  });
}

}  // namespace
}  // namespace sgf::alignment
