#include <algorithm>
#include <cstdio>
#include <exception>

#include <fmt/core.h>

#include <sgf/apps/cli.h>
#include <sgf/core/provenance.h>
#include <sgf/core/simd.h>

namespace sgf::apps {

int RunTool(CLI::App& app, int argc, char** argv, const std::function<void()>& body) {
  constexpr int kBadInput = 2;
  const auto report = [&](const char* what) {
    fmt::print(stderr, "{}: {}\n", app.get_name(), what);
  };
  try {
    app.parse(argc, argv);
    body();
    return 0;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kBadInput;
  } catch (const Error& error) {
    report(error.what());
    return kBadInput;
  } catch (const std::exception& error) {
    report(error.what());
    return 1;
  }
}

YAML::Node LoadYamlFile(const std::string& path) {
  try {
    return YAML::LoadFile(path);
  } catch (const YAML::BadFile&) {
    throw Error(path, "cannot be opened");
  } catch (const YAML::Exception& error) {
    throw Error(fmt::format("{}:{}", path, error.mark.line + 1), error.msg);
  }
}

YAML::Node DescribeBuild() {
  const Provenance& build = BuildProvenance();
  YAML::Node node;
  node["version"] = build.version;
  node["revision"] = build.git_revision;
  node["compiler"] = build.compiler;
  node["type"] = build.build_type;
  node["simd"] = ActiveSimdTarget();
  return node;
}

void OptionFlags::Add(CLI::App& app, const OptionDoc& doc,
                      const std::map<std::string, std::string>& renamed) {
  std::string flag = "--" + doc.name;
  std::replace(flag.begin(), flag.end(), '_', '-');
  if (const auto it = renamed.find(doc.name); it != renamed.end()) flag += "," + it->second;
  const std::string unit = doc.unit.empty() ? "" : ", " + doc.unit;
  const std::string text = fmt::format("{} (default {}{})", doc.text, doc.default_value, unit);
  app.add_option_function<std::string>(
      flag, [this, name = doc.name](const std::string& value) { SetOption(flags_, name, value); },
      text);
}

std::set<std::string> OptionFlags::Given() const {
  std::set<std::string> names;
  for (const YAML::Node& map : {LoadConfig().options, flags_})
    if (map.IsMap())
      for (const auto& entry : map) names.insert(entry.first.Scalar());
  return names;
}

namespace {

// The options.yaml of a run, in the form that options have.
struct RunFile {
  YAML::Node options, build;
  std::map<std::string, YAML::Node> choices;

  template <class V>
  void VisitFields(V&& visit) {
    visit("options", options, "", "");
    visit("build", build, "", "");
    for (auto& [name, choice] : choices) visit(name.c_str(), choice, "", "");
  }
};

}  // namespace

OptionFlags::Config OptionFlags::LoadConfig() const {
  if (config_.empty()) return {};
  const YAML::Node file = LoadYamlFile(config_);
  if (!file.IsMap() || !file["options"]) return {file, {}};
  RunFile run;
  for (const std::string& name : choices_) run.choices[name];
  ReadOptions(file, run, config_);
  return {run.options, run.choices};
}

}  // namespace sgf::apps
