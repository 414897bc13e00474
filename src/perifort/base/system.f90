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

  !> Memory that this program can still have [bytes], as Linux tells it: what is free, and what a
  !> limit on its address space leaves (`ulimit -v`, which queues set); huge elsewhere.
  function available_memory() result(bytes)
    integer(i8) :: bytes
    integer(i8) :: limit, used

    bytes = huge(bytes)
    used = number_of('/proc/meminfo', 'MemAvailable')
    if (used >= 0_i8) bytes = 1024_i8*used
    limit = number_of('/proc/self/limits', 'Max address space')
    used = number_of('/proc/self/status', 'VmSize')
    if (limit >= 0_i8 .and. used >= 0_i8) bytes = min(bytes, max(0_i8, limit - 1024_i8*used))
  end function available_memory

  !> The first number of an entry; negative if there is none.
  function number_of(file, name) result(number)
    character(*), intent(in) :: file, name
    integer(i8) :: number
    character(:), allocatable :: text
    integer :: status

    number = -1_i8
    text = entry_of(file, name)
    if (text == '') return
    read (text, *, iostat=status) number
    if (status /= 0) number = -1_i8
  end function number_of

  !> The text after `name` and a colon, if there is one, of the first line of `file` that begins so;
  !> '' without such a line.
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
      text = trim(adjustl(line(max(index(line, ':'), len(name)) + 1:)))
      exit
    end do
    close (unit)
  end function entry_of

end module pd_base_system
