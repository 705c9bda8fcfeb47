#include <algorithm>
#include <array>
#include <limits>

#include <embree3/rtcore.h>
#include <fmt/core.h>
#include <tbb/global_control.h>

#include <sgf/core/error.h>
#include <sgf/synth/ray_scene.h>

namespace sgf::synth::internal {

struct RayScene::Embree {
  RTCDevice device = rtcNewDevice("isa=sse4.2");
  RTCScene scene = nullptr;

  ~Embree() {
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
};

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Rays that Embree is given at once.
constexpr size_t kStream = 128;

/// Surface coordinates of a hit from Embree's coordinates in the quad.
void SetCoordinates(const Surface& surface, float u, float v, Hit& hit) {
  const unsigned nu = surface.patch ? surface.patch->nu : 1;
  const unsigned nv = surface.patch ? surface.patch->nv : 1;
  // On slivers Embree's coordinates may leave [0, 1] or be no numbers.
  const auto inside = [](float x) { return x > 0 ? std::min(x, 1.0f) : 0.0f; };
  hit.s = (static_cast<float>(hit.quad % nu) + inside(u)) / static_cast<float>(nu);
  hit.t = (static_cast<float>(hit.quad / nu) + inside(v)) / static_cast<float>(nv);
}

RTCRayHit Query(const Ray& ray) {
  RTCRayHit query;
  query.ray = {.org_x = ray.origin.x(),
               .org_y = ray.origin.y(),
               .org_z = ray.origin.z(),
               .tnear = 0,
               .dir_x = ray.direction.x(),
               .dir_y = ray.direction.y(),
               .dir_z = ray.direction.z(),
               .time = 0,
               .tfar = kInfinity,
               .mask = ~0u,
               .id = 0,
               .flags = 0};
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return query;
}

/// Place of a triangle nearest to the origin (Ericson, "Real-Time Collision Detection", 5.1.5): at
/// a corner, on an edge, or inside.
Eigen::Vector3f NearestOfTriangle(const Eigen::Vector3f& a, const Eigen::Vector3f& b,
                                  const Eigen::Vector3f& c) {
  const Eigen::Vector3f ab = b - a, ac = c - a, bc = c - b;
  const float a1 = -ab.dot(a), a2 = -ac.dot(a);
  if (a1 <= 0 && a2 <= 0) return a;
  const float b1 = -ab.dot(b), b2 = -ac.dot(b);
  if (b1 >= 0 && b2 <= b1) return b;
  const float c1 = -ab.dot(c), c2 = -ac.dot(c);
  if (c2 >= 0 && c1 <= c2) return c;
  const float wc = a1 * b2 - b1 * a2;
  if (wc <= 0 && a1 >= 0 && b1 <= 0) return a + a1 / (a1 - b1) * ab;
  const float wb = c1 * a2 - a1 * c2;
  if (wb <= 0 && a2 >= 0 && c2 <= 0) return a + a2 / (a2 - c2) * ac;
  const float wa = b1 * c2 - c1 * b2;
  if (wa <= 0 && b2 >= b1 && c1 >= c2) return b + (b2 - b1) / (b2 - b1 + c1 - c2) * bc;
  return a + (wb * ab + wc * ac) / (wa + wb + wc);
}

/// What Embree's search for the nearest place carries along.
struct NearestSearch {
  RTCScene scene;
  Eigen::Vector3f point;
  NearPlace found;
};

/// Takes a quad that may be nearer than what was found so far, and if so shrinks the search to it.
bool VisitQuad(RTCPointQueryFunctionArguments* visit) {
  auto& search = *static_cast<NearestSearch*>(visit->userPtr);
  const RTCGeometry geometry = rtcGetGeometry(search.scene, visit->geomID);
  const auto* points = static_cast<const Eigen::Vector3f*>(
      rtcGetGeometryBufferData(geometry, RTC_BUFFER_TYPE_VERTEX, 0));
  const unsigned* quad =
      static_cast<const unsigned*>(rtcGetGeometryBufferData(geometry, RTC_BUFFER_TYPE_INDEX, 0)) +
      4 * size_t{visit->primID};
  bool nearer = false;
  for (const auto& [i, j, k] : {std::array{0, 1, 3}, std::array{2, 3, 1}}) {
    const Eigen::Vector3f a = points[quad[i]] - search.point, b = points[quad[j]] - search.point,
                          c = points[quad[k]] - search.point;
    const Eigen::Vector3f nearest = NearestOfTriangle(a, b, c);
    const float distance = nearest.norm();  // no number where the triangle has no area
    if (!(distance < visit->query->radius)) continue;
    visit->query->radius = distance;
    search.found = {static_cast<int>(visit->geomID), search.point + nearest, (b - a).cross(c - a)};
    nearer = true;
  }
  return nearer;
}

RTCIntersectContext Context(RTCIntersectContextFlags flags) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = flags;
  return context;
}

}  // namespace

RayScene::RayScene(const Scene& scene) : embree_(std::make_unique<Embree>()) {
  if (!embree_->device) throw Error("Embree", "the ray tracing device cannot be opened");
  embree_->scene = rtcNewScene(embree_->device);
  rtcSetSceneFlags(embree_->scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(embree_->scene, RTC_BUILD_QUALITY_HIGH);
  int id = 0;
  for (const Object& object : scene.objects) {
    ++id;
    for (const Part& part : object.parts)
      for (const Patch& patch : part.patches) {
        surfaces_.push_back({&patch, &part.material, id});
        AddPatch(patch);
      }
  }
  const std::vector<std::string> groups = scene.LightGroups();
  for (const AreaLight& lamp : scene.lights) {
    if (lamp.hidden) continue;
    const auto group = std::find(groups.begin(), groups.end(), lamp.group) - groups.begin();
    surfaces_.push_back({.group = static_cast<int>(group), .lamp = &lamp});
    AddLamp(lamp);
  }
  {
    // The order of parallel builders decides which of two touching quads a ray along their border
    // hits.
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    rtcCommitScene(embree_->scene);
  }
  if (rtcGetDeviceError(embree_->device) != RTC_ERROR_NONE)
    throw Error("Embree", fmt::format("scene '{}' cannot be built", scene.name));
}

RayScene::~RayScene() = default;

void RayScene::AddPatch(const Patch& patch) {
  RTCGeometry geometry = rtcNewGeometry(embree_->device, RTC_GEOMETRY_TYPE_QUAD);
  auto* points = static_cast<Eigen::Vector3f*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              sizeof(Eigen::Vector3f), patch.points.size()));
  std::copy(patch.points.begin(), patch.points.end(), points);
  auto* index = static_cast<unsigned*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4,
                              4 * sizeof(unsigned), static_cast<size_t>(patch.nu) * patch.nv));
  for (int j = 0; j < patch.nv; ++j)
    for (int i = 0; i < patch.nu; ++i) {
      const unsigned corner = j * (patch.nu + 1) + i;
      for (unsigned k : {corner, corner + 1, corner + patch.nu + 2, corner + patch.nu + 1})
        *index++ = k;
    }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(embree_->scene, geometry);
  rtcReleaseGeometry(geometry);
}

void RayScene::AddLamp(const AreaLight& lamp) {
  for (const Patch& patch : Quad(lamp.corner, lamp.edge_s, lamp.edge_t)) AddPatch(patch);
}

void RayScene::Intersect(std::span<const Ray> rays, Hit* hits) const {
  std::array<RTCRayHit, kStream> queries;
  for (size_t first = 0; first < rays.size(); first += kStream) {
    const size_t count = std::min(kStream, rays.size() - first);
    for (size_t k = 0; k < count; ++k) queries[k] = Query(rays[first + k]);
    RTCIntersectContext context = Context(RTC_INTERSECT_CONTEXT_FLAG_COHERENT);
    rtcIntersect1M(embree_->scene, &context, queries.data(), static_cast<unsigned>(count),
                   sizeof(RTCRayHit));
    for (size_t k = 0; k < count; ++k) hits[first + k] = Answer(queries[k]);
  }
}

Hit RayScene::Intersect(const Ray& ray) const {
  RTCRayHit query = Query(ray);
  RTCIntersectContext context = Context(RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
  rtcIntersect1(embree_->scene, &context, &query);
  return Answer(query);
}

Hit RayScene::Answer(const RTCRayHit& query) const {
  Hit hit;
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return hit;
  hit.surface = static_cast<int>(query.hit.geomID);
  hit.quad = query.hit.primID;
  hit.distance = query.ray.tfar;
  hit.plane_normal = {query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z};
  SetCoordinates(surfaces_[hit.surface], query.hit.u, query.hit.v, hit);
  return hit;
}

NearPlace RayScene::Nearest(const Eigen::Vector3f& point) const {
  RTCPointQuery query{
      .x = point.x(), .y = point.y(), .z = point.z(), .time = 0, .radius = kInfinity};
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  NearestSearch search{embree_->scene, point, {}};
  rtcPointQuery(embree_->scene, &query, &context, VisitQuad, &search);
  return search.found;
}

bool RayScene::Blocked(const Eigen::Vector3f& from, const Eigen::Vector3f& to) const {
  const Eigen::Vector3f d = to - from;
  // The lamp at the far end is geometry too, so the last bit of the way is left out.
  RTCRay ray{.org_x = from.x(),
             .org_y = from.y(),
             .org_z = from.z(),
             .tnear = 0,
             .dir_x = d.x(),
             .dir_y = d.y(),
             .dir_z = d.z(),
             .time = 0,
             .tfar = 0.999f,
             .mask = ~0u,
             .id = 0,
             .flags = 0};
  RTCIntersectContext context = Context(RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
  rtcOccluded1(embree_->scene, &context, &ray);
  return ray.tfar < 0;
}

}  // namespace sgf::synth::internal
