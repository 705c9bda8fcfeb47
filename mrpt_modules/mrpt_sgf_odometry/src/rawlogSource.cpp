/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <mrpt/core/exceptions.h>
#include <mrpt/img/CImage.h>
#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CRawlog.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/serialization/CArchive.h>
#include <mrpt/sgf/CObservationSource.h>

#include <deque>
#include <filesystem>

#include "messageOf.h"

namespace mrpt::sgf
{
using mrpt::obs::CActionCollection;
using mrpt::obs::CObservation;
using mrpt::obs::CRawlog;
using mrpt::obs::CSensoryFrame;
using mrpt::serialization::CSerializable;

namespace
{
namespace fs = std::filesystem;

// The folder that CRawlog::detectImagesDirectory() is documented to find. In
// MRPT 2.5.8 it does so for a rawlog in the current folder only: otherwise it
// forgets the slash.
std::string imagesDirectory(const fs::path& rawlog)
{
	for (const auto ending : {"_Images", "_images", "_IMAGES"})
	{
		const fs::path folder =
			rawlog.parent_path() / (rawlog.stem().string() + ending);
		if (fs::is_directory(folder)) return folder.string();
	}
	return (rawlog.parent_path() / "Images").string();
}

class CRawlogSource : public CObservationSource
{
 public:
	explicit CRawlogSource(const std::string& file) : m_file(file)
	{
		if (!fs::is_regular_file(file) || !m_stream.open(file))
			THROW_EXCEPTION_FMT("%s: cannot be opened", file.c_str());
		mrpt::img::CImage::setImagesPathBase(imagesDirectory(file));
		readSome();
	}

	CObservation::Ptr next() override
	{
		while (m_queue.empty() && !m_ended) readSome();
		if (m_queue.empty()) return {};
		CObservation::Ptr obs = m_queue.front();
		m_queue.pop_front();
		return obs;
	}

 private:
	// Reads one object into the queue, or finds the end.
	void readSome()
	{
		const auto begin = m_stream.getPosition();
		auto archive = mrpt::serialization::archiveFrom(m_stream);
		CSerializable::Ptr object;
		try
		{
			object = archive.ReadObject();
		}
		catch (const std::exception& e)
		{
			// A file may only end between objects.
			m_ended = true;
			const bool clean = m_objects > 0 && m_stream.getPosition() == begin;
			if (clean) return;
			THROW_EXCEPTION_FMT(
				"%s: object %zu cannot be read: %s", m_file.c_str(), m_objects,
				internal::messageOf(e).c_str());
		}
		++m_objects;
		take(object);
	}

	void take(const CSerializable::Ptr& object)
	{
		if (auto obs = std::dynamic_pointer_cast<CObservation>(object))
			m_queue.push_back(obs);
		else if (auto frame = std::dynamic_pointer_cast<CSensoryFrame>(object))
			m_queue.insert(m_queue.end(), frame->begin(), frame->end());
		else if (auto rawlog = std::dynamic_pointer_cast<CRawlog>(object))
			for (const auto& inner : *rawlog) take(inner);
		else if (!std::dynamic_pointer_cast<CActionCollection>(object))
			THROW_EXCEPTION_FMT(
				"%s: object %zu of class %s has no place in a rawlog",
				m_file.c_str(), m_objects - 1,
				object->GetRuntimeClass()->className);
	}

	std::string m_file;
	mrpt::io::CFileGZInputStream m_stream;
	std::deque<CObservation::Ptr> m_queue;
	size_t m_objects = 0;
	bool m_ended = false;
};

}  // namespace

std::unique_ptr<CObservationSource> openRawlog(const std::string& file)
{
	return std::make_unique<CRawlogSource>(file);
}

}  // namespace mrpt::sgf
