!> Data about the machine from Linux; other systems give no data.
module pd_base_system
  use pd_base_kinds, only: wp, i8
  implicit none (type, external)
  private
  public :: processor_name, available_memory, peak_memory, processor_quota

contains

  !> The processor's name, as reported by Linux; 'unknown' elsewhere.
  function processor_name() result(name)
    character(:), allocatable :: name
    name = entry_of('/proc/cpuinfo', 'model name')
    if (name == '') name = 'unknown'
  end function processor_name

  !> Memory that this program can still have [bytes], as reported by Linux: what is free, and what a
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

  !> The most memory that this process has had in use [bytes], as reported by Linux; 0 elsewhere.
  integer(i8) function peak_memory() result(bytes)
    bytes = 1024_i8*max(0_i8, number_of('/proc/self/status', 'VmHWM'))
  end function peak_memory

  !> Processor cores whose time this program may use, rounded up, as the control groups of Linux
  !> (versions 2 and 1) limit it: containers and queues set such limits, which the number of cores
  !> does not show. Huge without a limit.
  function processor_quota(root) result(cores)
    character(*), intent(in), optional :: root  !! folder that holds `proc` and `sys`, default ''
    integer :: cores
    character(:), allocatable :: top, path

    top = ''
    if (present(root)) top = root
    cores = huge(cores)
    ! version 2: the program's own group and all above it have a limit, each as "quota period"
    path = entry_of(top//'/proc/self/cgroup', '0:')
    if (len(path) > 0) path = path(2:)
    do
      cores = min(cores, whole_cores(entry_of(top//'/sys/fs/cgroup'//path//'/cpu.max', '')))
      if (index(path, '/') == 0) exit
      path = path(:index(path, '/', back=.true.) - 1)
    end do
    ! version 1: a container sees its own group's limit here
    associate (group => top//'/sys/fs/cgroup/cpu/cpu.cfs_')
      cores = min(cores, whole_cores(entry_of(group//'quota_us', '')//' '// &
        & entry_of(group//'period_us', '')))
    end associate
  end function processor_quota

  !> Cores of a limit "quota period" (both in us), rounded up; huge if it is none ("max", -1).
  pure integer function whole_cores(limit) result(cores)
    character(*), intent(in) :: limit
    real(wp) :: quota, period
    integer :: status

    cores = huge(cores)
    read (limit, *, iostat=status) quota, period
    if (status /= 0) return
    if (.not. (quota > 0.0_wp .and. period > 0.0_wp .and. quota/period < 1.0e9_wp)) return
    cores = max(1, ceiling(quota/period*(1 - 1.0e-9_wp)))
  end function whole_cores

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
