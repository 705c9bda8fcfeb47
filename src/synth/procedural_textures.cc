#include <algorithm>
#include <string>

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <sgf/core/error.h>
#include <sgf/synth/texture.h>
#include <sgf/synth/texture_painter.h>

namespace sgf::synth {
namespace {

std::vector<TextureRecipe> JoinRecipes() {
  std::vector<TextureRecipe> all(SurfaceRecipes().begin(), SurfaceRecipes().end());
  all.insert(all.end(), PictureRecipes().begin(), PictureRecipes().end());
  return all;
}

const std::vector<TextureRecipe>& Recipes() {
  static const std::vector<TextureRecipe> recipes = JoinRecipes();
  return recipes;
}

std::vector<TextureInfo> JoinInfos() {
  std::vector<TextureInfo> infos;
  for (const TextureRecipe& recipe : Recipes()) infos.push_back(recipe.info);
  return infos;
}

}  // namespace

std::span<const TextureInfo> AllTextures() {
  static const std::vector<TextureInfo> infos = JoinInfos();
  return infos;
}

cv::Mat3f MakeTexture(std::string_view name, int size_px, uint32_t seed) {
  if (size_px < 16) throw Error("texture size", fmt::format("must be 16 or more, got {}", size_px));
  const auto& recipes = Recipes();
  const auto found = std::find_if(recipes.begin(), recipes.end(),
                                  [&](const TextureRecipe& r) { return r.info.name == name; });
  if (found == recipes.end()) {
    std::vector<std::string_view> names;
    for (const TextureInfo& info : AllTextures()) names.push_back(info.name);
    throw Error("texture",
                fmt::format("\"{}\" is unknown; known are {}", name, fmt::join(names, ", ")));
  }
  return found->make(size_px, Hash64(seed, 0));
}

}  // namespace sgf::synth
