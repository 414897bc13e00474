!> What Linux tells of the machine; elsewhere nothing is known.
module pd_base_system
  use pd_base_kinds, only: i8
  implicit none (type, external)
  private
  public :: processor_name, available_memory

contains

  !> The processor's name, as Linux tells it; 'unknown' elsewhere.
  function processor_name() result(name)
    character(:), allocatable :: name
    name = entry_of('/proc/cpuinfo', 'model name')
    if (name == '') name = 'unknown'
  end function processor_name

  !> Memory that is free for programs [bytes], as Linux tells it; huge elsewhere.
  function available_memory() result(bytes)
    integer(i8) :: bytes
    character(:), allocatable :: text
    integer :: status

    bytes = huge(bytes)
    text = entry_of('/proc/meminfo', 'MemAvailable')
    if (text == '') return
    read (text, *, iostat=status) bytes
    if (status == 0) bytes = 1024_i8*bytes
    if (status /= 0) bytes = huge(bytes)
  end function available_memory

  !> The text after the colon of the first line of `file` that begins with `name`; '' without one.
  function entry_of(file, name) result(text)
    character(*), intent(in) :: file, name
    character(:), allocatable :: text
    character(500) :: line
    integer :: unit, status

    text = ''
    open (newunit=unit, file=file, status='old', action='read', iostat=status)
    if (status /= 0) return
    do
      read (unit, '(a)', iostat=status) line
      if (status /= 0) exit
      if (index(line, name) /= 1) cycle
      text = trim(adjustl(line(index(line, ':') + 1:)))
      exit
    end do
    close (unit)
  end function entry_of

end module pd_base_system
