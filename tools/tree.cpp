// varve tree: the lineage of the runs and forks in a folder.
#include <algorithm>
#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "io/errors.h"
#include "io/log_reader.h"
#include "tools/cli.h"

namespace {

using namespace varve;
using namespace varve::tools;
using json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr std::size_t none = static_cast<std::size_t>(-1);

struct Run {
  std::string file;  ///< name within the folder
  std::string run_id;
  std::uint64_t first_step = 0, last_step = 0;
  double time = 0;  ///< [s] at last_step
  std::string chain;
  std::optional<io::Lineage> lineage;
  io::Completeness completeness = io::Completeness::complete;
  bool closed = false;
  std::size_t parent = none;
  std::vector<std::size_t> children;
};

struct Family {
  std::vector<Run> runs;  ///< by name
  std::vector<std::pair<std::string, std::string>> unreadable;  ///< file, reason
};

Run read_run(const fs::path& path) {
  const auto log = io::LogReader::open(path.string());
  Run out;
  out.file = path.filename().string();
  out.run_id = log->genesis().run_id();
  out.first_step = log->first_step();
  out.last_step = log->last_step();
  out.lineage = log->genesis().lineage;
  out.completeness = log->completeness();
  out.closed = log->closed();
  if (const auto header = log->header(out.last_step)) {
    out.time = header->time;
    out.chain = header->chain.hex();
  }
  return out;
}

// Files that are no logs at all are passed over, unless their name claims otherwise.
Family read_folder(const std::string& folder) {
  std::error_code error;
  std::vector<fs::path> paths;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    std::error_code unknown;
    if (at->is_regular_file(unknown)) paths.push_back(at->path());
  }
  if (error) throw UsageError(fmt::format("{}: {}", folder, error.message()));
  std::sort(paths.begin(), paths.end());
  Family out;
  for (const fs::path& path : paths) {
    try {
      out.runs.push_back(read_run(path));
    } catch (const io::LogError& failure) {
      if (failure.kind() != io::ErrorKind::not_a_log || path.extension() == ".varve")
        out.unreadable.emplace_back(path.filename().string(), failure.what());
    }
  }
  return out;
}

// Copies of one run share its id; a child belongs to the first copy, by name, that holds its step.
void connect(Family& family) {
  for (std::size_t i = 0; i < family.runs.size(); ++i) {
    Run& child = family.runs[i];
    if (!child.lineage) continue;
    for (std::size_t p = 0; p < family.runs.size(); ++p) {
      const Run& candidate = family.runs[p];
      if (p == i || candidate.run_id != child.lineage->parent_run_id) continue;
      const bool holds =
          candidate.first_step <= child.lineage->step && child.lineage->step <= candidate.last_step;
      if (child.parent == none || holds) child.parent = p;
      if (holds) break;
    }
  }
  for (std::size_t i = 0; i < family.runs.size(); ++i)
    if (family.runs[i].parent != none) family.runs[family.runs[i].parent].children.push_back(i);
  for (Run& run : family.runs)
    std::stable_sort(run.children.begin(), run.children.end(), [&](std::size_t x, std::size_t y) {
      return family.runs[x].lineage->step < family.runs[y].lineage->step;
    });
}

std::string changes_text(const io::Lineage& lineage) {
  if (lineage.changes.empty()) return "no change";
  std::string out;
  for (const io::Lineage::Change& change : lineage.changes)
    out +=
        fmt::format("{}{} {} -> {}", out.empty() ? "" : ", ", change.key, change.from, change.to);
  return out;
}

std::string run_text(const Run& run) {
  constexpr std::size_t short_chain = 8;
  std::string out = run.file;
  if (run.lineage) out += fmt::format("  @{}  {}", run.lineage->step, changes_text(*run.lineage));
  if (run.lineage && run.parent == none)
    out += fmt::format("  (parent {} not here, run {})", run.lineage->parent_name,
                       run.lineage->parent_run_id);
  out += fmt::format("  steps {}..{}  t={} s  {}", run.first_step, run.last_step, run.time,
                     run.chain.substr(0, short_chain));
  if (run.completeness != io::Completeness::complete)
    out += fmt::format("  {}", name_of(run.completeness));
  else if (!run.closed)
    out += "  not closed";
  return out;
}

void add_branch(const Family& family, std::size_t index, const std::string& indent,
                std::string& out) {
  const std::vector<std::size_t>& children = family.runs[index].children;
  for (std::size_t k = 0; k < children.size(); ++k) {
    const bool last = k + 1 == children.size();
    out += indent + (last ? "`- " : "|- ") + run_text(family.runs[children[k]]) + "\n";
    add_branch(family, children[k], indent + (last ? "   " : "|  "), out);
  }
}

std::string text(const Family& family, const std::string& folder) {
  std::string out;
  for (std::size_t i = 0; i < family.runs.size(); ++i) {
    if (family.runs[i].parent != none) continue;
    out += run_text(family.runs[i]) + "\n";
    add_branch(family, i, "", out);
  }
  if (family.runs.empty()) out += fmt::format("no runs in {}\n", folder);
  for (const auto& [file, reason] : family.unreadable)
    out += fmt::format("{}  unreadable: {}\n", file, reason);
  return out;
}

json run_json(const Family& family, const Run& run) {
  json out{{"run", run.file},
           {"run_id", run.run_id},
           {"first_step", std::to_string(run.first_step)},
           {"last_step", std::to_string(run.last_step)},
           {"steps", std::to_string(run.last_step - run.first_step)},
           {"time_s", run.time},
           {"final_chain", run.chain},
           {"completeness", name_of(run.completeness)},
           {"closed", run.closed},
           {"parent", run.parent == none ? json(nullptr) : json(family.runs[run.parent].file)},
           {"orphan", run.lineage.has_value() && run.parent == none},
           {"lineage", nullptr},
           {"children", json::array()}};
  if (run.lineage) {
    json changes = json::array();
    for (const io::Lineage::Change& change : run.lineage->changes)
      changes.push_back({{"key", change.key}, {"from", change.from}, {"to", change.to}});
    out["lineage"] = {{"parent", run.lineage->parent_run_id},
                      {"parent_name", run.lineage->parent_name},
                      {"step", std::to_string(run.lineage->step)},
                      {"digest", run.lineage->parent_digest.hex()},
                      {"changes", changes}};
  }
  for (const std::size_t child : run.children) out["children"].push_back(family.runs[child].file);
  return out;
}

std::string json_text(const Family& family, const std::string& folder) {
  json out{{"schema", "varve.tree/1"},
           {"folder", folder},
           {"runs", json::array()},
           {"unreadable", json::array()}};
  for (const Run& run : family.runs) out["runs"].push_back(run_json(family, run));
  for (const auto& [file, reason] : family.unreadable)
    out["unreadable"].push_back({{"file", file}, {"reason", reason}});
  return out.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

int run_tree(const Invocation& invocation) {
  const std::string folder = invocation.arguments.empty() ? "." : invocation.arguments[0];
  if (!fs::is_directory(folder))
    throw UsageError(fmt::format(
        "{}: {}", folder, fs::exists(folder) ? "is a file; a folder is needed" : "no such folder"));
  Family family = read_folder(folder);
  connect(family);
  print(invocation.globals.json ? json_text(family, folder) : text(family, folder));
  return exit_ok;
}

Verb verb() {
  Verb out;
  out.name = "tree";
  out.usage = "[DIR]";
  out.summary = "shows which run in a folder was forked from which, where and with what change";
  out.description =
      "Every log directly in DIR (default: here), parents found by run id. A fork whose parent is\n"
      "not there is shown at the top, a log that can't be read at the end, with the reason.\n"
      "\n"
      "  varve tree\n"
      "  varve tree results --json\n";
  out.arguments_min = 0;
  out.arguments_max = 1;
  out.run = run_tree;
  return out;
}

}  // namespace

int main(int argc, char** argv) { return verb_main(argc, argv, verb()); }
