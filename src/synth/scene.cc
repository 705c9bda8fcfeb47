#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include <sgf/core/error.h>
#include <sgf/synth/scene.h>

namespace sgf::synth {

int Scene::AddTexture(std::string_view texture, int size_px, uint32_t seed) {
  textures.emplace_back(MakeTexture(texture, size_px, seed));
  return static_cast<int>(textures.size()) - 1;
}

void Scene::Add(std::string object_name, Patches patches, const Material& material) {
  Add(std::move(object_name), {Part{std::move(patches), material}});
}

void Scene::Add(std::string object_name, std::vector<Part> parts) {
  objects.push_back({std::move(object_name), std::move(parts)});
}

std::vector<std::string> Scene::LightGroups() const {
  std::vector<std::string> groups;
  const auto add = [&](const std::string& group) {
    if (std::find(groups.begin(), groups.end(), group) == groups.end()) groups.push_back(group);
  };
  for (const AreaLight& light : lights) add(light.group);
  if (sky) add(sky->group);
  return groups;
}

std::span<const SceneInfo> AllScenes() {
  static const std::array<SceneInfo, 5> kScenes = {{
      {"living_room", "a furnished living room, after ICL-NUIM's", LivingRoom},
      {"machine_hall", "a hall with tanks, pipes and racks, after EuRoC's MH", MachineHall},
      {"mocap_room_1", "a motion-capture room with mattresses and boxes, after EuRoC's V1",
       MocapRoom1},
      {"mocap_room_2", "the same room furnished anew, after EuRoC's V2", MocapRoom2},
      {"street", "facades, parked cars and a road, after KITTI", Street},
  }};
  return kScenes;
}

Scene BuildScene(std::string_view name) {
  std::string known;
  for (const SceneInfo& scene : AllScenes()) {
    if (scene.name == name) return scene.build();
    known += (known.empty() ? "" : ", ") + std::string(scene.name);
  }
  throw Error("scene", fmt::format("unknown scene '{}'; known: {}", name, known));
}

}  // namespace sgf::synth
