/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/core/exceptions.h>
#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/serialization/CArchive.h>

#include <filesystem>
#include <string>

namespace mrpt::sgf::apps
{
/** Writes the objects of a rawlog one by one. The file has its name once it is
 * complete; an older one stays until then. */
class CRawlogWriter
{
 public:
	explicit CRawlogWriter(const std::string& file)
		: m_file(file), m_partial(file + ".part")
	{
		if (!m_stream.open(m_partial))
			THROW_EXCEPTION_FMT("%s: cannot be written", file.c_str());
	}

	~CRawlogWriter()
	{
		std::error_code ignored;
		std::filesystem::remove(m_partial, ignored);
	}

	void write(const mrpt::serialization::CSerializable& object)
	{
		mrpt::serialization::archiveFrom(m_stream).WriteObject(&object);
	}

	/** Gives the file its name; to be called last. */
	void commit()
	{
		m_stream.close();
		std::filesystem::rename(m_partial, m_file);
	}

 private:
	std::string m_file, m_partial;
	mrpt::io::CFileGZOutputStream m_stream;
};

}  // namespace mrpt::sgf::apps
