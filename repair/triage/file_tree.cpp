#include "repair/triage/file_tree.h"

#include <algorithm>
#include <cctype>
#include <deque>
#include <filesystem>
#include <set>

#include <fmt/format.h>

namespace sixpoint::repair {
namespace {

struct Place {
  std::string path;
  std::string relative;
};

class Walk {
 public:
  Walk(FileSystem& files, const FileTreeOptions& options) : files_(files), options_(options) {}

  Result<FileTree> from(const std::string& root) {
    SIXPOINT_ASSIGN(const auto info, files_.info(root));
    if (!info.is_folder) {
      found_.files.push_back({root, file_name_of(root), info.size, info.modified_ns});
      return std::move(found_);
    }
    SIXPOINT_ASSIGN(real_root_, files_.real_path(root));
    // The root itself must be readable: everything else is a matter of its own line.
    SIXPOINT_CHECK(files_.list(root));
    visit({root, ""}, info);
    while (!links_.empty()) {
      const Place link = std::move(links_.front());
      links_.pop_front();
      follow(link);
    }
    std::sort(found_.files.begin(), found_.files.end(), [](const FoundFile& a, const FoundFile& b) {
      return std::lexicographical_compare(a.relative.begin(), a.relative.end(), b.relative.begin(),
                                          b.relative.end(),
                                          [](char x, char y) { return rank(x) < rank(y); });
    });
    return std::move(found_);
  }

 private:
  // Folder by folder: what is in a folder comes before what its name continues into.
  static int rank(char c) { return c == '/' ? 0 : 1 + static_cast<unsigned char>(c); }

  // "._day1.gt3x" beside "day1.gt3x" holds what macOS notes about it on other systems' disks.
  bool wanted(const std::string& path) const {
    const std::string name = file_name_of(path);
    return !name.starts_with("._") &&
           std::any_of(options_.endings.begin(), options_.endings.end(),
                       [&](const std::string& ending) { return has_ending(name, ending); });
  }

  // The folder and all real folders below it. No recursion: the depth is a stranger's choice.
  void visit(const Place& folder, const FileInfo& its_info) {
    if (!is_new(its_info)) {
      return;
    }
    std::vector<Place> open = {folder};
    while (!open.empty()) {
      const Place here = std::move(open.back());
      open.pop_back();
      const auto names = files_.list(here.path);
      if (!names) {
        found_.refused.push_back({here.path, names.error()});
        continue;
      }
      for (const std::string& name : *names) {
        take({here.path.ends_with('/') ? here.path + name : here.path + "/" + name,
              here.relative.empty() ? name : here.relative + "/" + name},
             open);
      }
    }
  }

  void take(Place place, std::vector<Place>& open) {
    const auto info = files_.link_info(place.path);
    if (!info) {
      // Gone since the folder was listed, or a folder that may not be read.
      if (info.error().code != ErrorCode::no_input && wanted(place.path)) {
        found_.refused.push_back({place.path, info.error()});
      }
    } else if (info->is_link) {
      links_.push_back(std::move(place));
    } else if (info->is_folder) {
      if (is_new(*info)) {
        open.push_back(std::move(place));
      }
    } else if (wanted(place.path)) {
      found_.files.push_back(
          {std::move(place.path), std::move(place.relative), info->size, info->modified_ns});
    }
  }

  void follow(const Place& link) {
    const auto info = files_.info(link.path);
    if (!info) {
      if (wanted(link.path)) {
        found_.refused.push_back({link.path, info.error()});
      }
      return;
    }
    if (!info->is_folder && !wanted(link.path)) {
      return;
    }
    const auto real = files_.real_path(link.path);
    if (!options_.follow_out && !(real && is_inside(*real, real_root_))) {
      found_.not_followed.push_back(link.path);
    } else if (info->is_folder) {
      visit(link, *info);
    } else {
      found_.files.push_back({link.path, link.relative, info->size, info->modified_ns});
    }
  }

  bool is_new(const FileInfo& folder) {
    return (folder.device == 0 && folder.inode == 0) ||
           seen_.emplace(folder.device, folder.inode).second;
  }

  FileSystem& files_;
  const FileTreeOptions& options_;
  std::string real_root_;
  FileTree found_;
  std::deque<Place> links_;
  std::set<std::pair<std::uint64_t, std::uint64_t>> seen_;
};

}  // namespace

std::string plain_path(const std::string& path) {
  const std::filesystem::path whole(path);
  const bool climbs = std::ranges::find(whole, "..") != whole.end();
  return climbs ? path : whole.lexically_normal().string();
}

bool has_ending(const std::string& path, const std::string& ending) {
  return path.size() >= ending.size() &&
         std::equal(ending.rbegin(), ending.rend(), path.rbegin(), [](char a, char b) {
           return std::tolower(static_cast<unsigned char>(a)) ==
                  std::tolower(static_cast<unsigned char>(b));
         });
}

bool is_inside(const std::string& path, const std::string& folder) {
  return path == folder || folder == "/" || path.starts_with(folder + "/");
}

Result<FileTree> find_files(FileSystem& files, const std::string& path,
                            const FileTreeOptions& options) {
  return Walk(files, options).from(path);
}

}  // namespace sixpoint::repair
