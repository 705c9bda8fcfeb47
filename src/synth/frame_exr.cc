#include <sgf/core/error.h>
#include <sgf/synth/frame_exr.h>

namespace sgf::synth {

namespace {

constexpr const char* kLightPrefix = "light.";

/// Groups of an image's light layers, in the order that the header lists them.
std::vector<std::string> LightGroups(const ExrImage& image) {
  const std::string prefix = kLightPrefix;
  std::vector<std::string> groups;
  for (const auto& [name, channel] : image.channels)
    if (name.starts_with(prefix) && name.ends_with(".R"))
      groups.push_back(name.substr(prefix.size(), name.size() - prefix.size() - 2));
  return groups;
}

}  // namespace

ExrImage ToExr(const Frame& frame, const Camera& camera, const SE3& T_world_cam) {
  ExrImage image;
  SetLayer(image, "", frame.Radiance());
  for (size_t g = 0; g < frame.groups.size(); ++g)
    SetLayer(image, kLightPrefix + frame.groups[g], frame.light[g]);
  SetLayer(image, "diffuse", frame.diffuse);
  SetLayer(image, "N", frame.normal, "XYZ");
  image.channels["Z"] = {frame.depth, ExrStorage::kFloat};
  image.channels["id"] = {frame.id, ExrStorage::kUint};
  image.camera = camera;
  image.T_world_cam = T_world_cam;
  return image;
}

Frame FromExr(const ExrImage& image, const std::string& where) {
  Frame frame;
  frame.groups = LightGroups(image);
  if (frame.groups.empty()) throw Error(where, "no layer light.<group> in the image");
  for (const std::string& group : frame.groups)
    frame.light.push_back(GetLayer(image, kLightPrefix + group, where));
  frame.diffuse = GetLayer(image, "diffuse", where);
  frame.normal = GetLayer(image, "N", where, "XYZ");
  RequireChannels(image, {"Z", "id"}, where);
  frame.depth = image.channels.at("Z").values;
  frame.id = image.channels.at("id").values;
  if (frame.depth.type() != CV_32FC1 || frame.id.type() != CV_32SC1)
    throw Error(where, "Z has to hold floating-point numbers and id whole ones");
  return frame;
}

}  // namespace sgf::synth
