#include "tools/diff_genesis.h"

#include <algorithm>

#include <fmt/format.h>

namespace varve::tools {
namespace {

using Pairs = std::vector<std::pair<std::string, std::string>>;

void add_keys(const std::string& part, const Pairs& a, const Pairs& b,
              std::vector<GenesisDifference>& out) {
  for (KeyDifference& d : compare_keys(a, b))
    out.push_back({part, std::move(d.key), std::move(d.a), std::move(d.b)});
}

// Contents are too long to show: their digests stand for them.
Pairs digests_of(const Pairs& files) {
  Pairs out;
  for (const auto& [name, content] : files) out.emplace_back(name, io::digest_text(content).hex());
  return out;
}

std::string changes_text(const io::Lineage& lineage) {
  if (lineage.changes.empty()) return "no change";
  std::string out;
  for (const io::Lineage::Change& change : lineage.changes)
    out +=
        fmt::format("{}{} {} -> {}", out.empty() ? "" : ", ", change.key, change.from, change.to);
  return out;
}

std::string fork_text(char child, char parent, const io::Lineage& lineage) {
  return fmt::format("{} is a fork of {} at step {} ({}): the steps before {} are one history",
                     child, parent, lineage.step, changes_text(lineage), lineage.step);
}

bool has(const std::vector<std::string>& ids, const std::string& id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

// Parent first, then further back.
std::vector<std::string> ancestors_of(const io::Genesis& genesis) {
  std::vector<std::string> out;
  if (!genesis.lineage) return out;
  out.push_back(genesis.lineage->parent_run_id);
  for (const std::string& id : genesis.lineage->ancestors)
    if (!has(out, id)) out.push_back(id);
  return out;
}

}  // namespace

std::vector<GenesisDifference> compare_geneses(const io::Genesis& a, const io::Genesis& b) {
  std::vector<GenesisDifference> out;
  add_keys("parameter", a.parameters, b.parameters, out);
  add_keys("model", a.models, b.models, out);
  add_keys("file", digests_of(a.files), digests_of(b.files), out);
  const auto add = [&](const char* part, const char* key, const std::string& x,
                       const std::string& y) {
    if (x != y) out.push_back({part, key, x, y});
  };
  // Text that no parameter explains (another engine may list none).
  if (out.empty() && a.scenario != b.scenario)
    add("scenario", "digest", io::digest_text(a.scenario).hex(), io::digest_text(b.scenario).hex());
  add("engine", "name", a.engine, b.engine);
  add("engine", "revision", std::to_string(a.engine_revision), std::to_string(b.engine_revision));
  add("record", "tier", std::string(io::name_of(a.tier)), std::string(io::name_of(b.tier)));
  add("record", "every", std::to_string(a.every), std::to_string(b.every));
  add("record", "keyframe_steps", std::to_string(a.keyframe_steps),
      std::to_string(b.keyframe_steps));
  add_keys("build", a.build, b.build, out);
  // Two runs never start at the same time; that explains nothing.
  std::erase_if(out,
                [](const GenesisDifference& d) { return d.part == "build" && d.key == "date"; });
  return out;
}

std::string describe_relation(const io::Genesis& a, const io::Genesis& b) {
  const std::string id_a = a.run_id(), id_b = b.run_id();
  if (b.lineage && b.lineage->parent_run_id == id_a) return fork_text('b', 'a', *b.lineage);
  if (a.lineage && a.lineage->parent_run_id == id_b) return fork_text('a', 'b', *a.lineage);
  const auto of_a = ancestors_of(a), of_b = ancestors_of(b);
  if (has(of_b, id_a))
    return fmt::format("b descends from a by several forks, the last at step {} ({})",
                       b.lineage->step, changes_text(*b.lineage));
  if (has(of_a, id_b))
    return fmt::format("a descends from b by several forks, the last at step {} ({})",
                       a.lineage->step, changes_text(*a.lineage));
  for (const std::string& id : of_a)
    if (has(of_b, id))
      return fmt::format("both descend from run {}: a forked at step {} ({}), b at step {} ({})",
                         id, a.lineage->step, changes_text(*a.lineage), b.lineage->step,
                         changes_text(*b.lineage));
  if (id_a == id_b) return "both record the same inputs";
  return "";
}

}  // namespace varve::tools
