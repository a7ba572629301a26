// Files that a scenario names, written below it as comments, so that one file reproduces a run:
//
//   #embedded file: list.csv
//   #|x,y
//   #|0.01,0.02
//   #:a last line without a line feed
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace varve::tools {

/// Name and content.
using NamedFiles = std::vector<std::pair<std::string, std::string>>;

/// The scenario's text with the files below it.
std::string with_embedded(std::string_view scenario, const NamedFiles& files);

struct SplitScenario {
  std::string_view scenario;  ///< what stands above the first embedded file
  NamedFiles files;
  int wrong_line = 0;         ///< line (from 1) that belongs to no file; 0: none
};
/// Takes such a text apart; a text without files is all scenario.
SplitScenario split_embedded(std::string_view text);

}  // namespace varve::tools
