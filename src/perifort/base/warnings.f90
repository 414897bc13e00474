!> Warnings of a run: each is printed once, counted, and kept for the results.
module pd_base_warnings
  use, intrinsic :: iso_fortran_env, only: error_unit
  use pd_base_archive, only: archive_type
  use pd_base_text, only: newline, printable, to_text
  implicit none (type, external)
  private
  public :: warnings_type

  integer, parameter :: most = 100  !! warnings that are kept one by one

  !> One warning.
  type :: warning_type
    character(:), allocatable :: subject  !! what makes it the same as another
    character(:), allocatable :: text
    integer :: times = 0
  end type warning_type

  type :: warnings_type
    private
    type(warning_type), allocatable :: list(:)
    integer :: number = 0
  contains
    procedure :: add
    procedure :: has
    procedure :: count => count_warnings
    procedure :: line
    procedure :: text => all_lines
    procedure :: keep => keep_warnings
  end type warnings_type

contains

  !> Note a warning. Another one of the same subject is counted, but its text is not kept. With
  !> `tell` the first of a subject is printed to standard error.
  subroutine add(self, subject, text, tell)
    class(warnings_type), intent(inout) :: self  !! the warnings; at most 100 subjects are kept
    character(*), intent(in) :: subject          !! what makes it the same as another warning
    character(*), intent(in) :: text             !! what the user reads
    logical, intent(in) :: tell                  !! whether to print the text to standard error, if
                                                 !! the subject is new
    integer :: i

    if (.not. allocated(self%list)) allocate (self%list(most))
    do i = 1, self%number
      if (self%list(i)%subject /= subject) cycle
      self%list(i)%times = self%list(i)%times + 1
      return
    end do
    if (tell) write (error_unit, '(2a)') 'warning: ', printable(text)
    if (self%number == most) return
    self%number = self%number + 1
    self%list(self%number) = warning_type(subject, text, 1)
  end subroutine add

  !> Whether there is a warning of this subject.
  pure logical function has(self, subject)
    class(warnings_type), intent(in) :: self  !! the warnings
    character(*), intent(in) :: subject       !! as given to `add`
    integer :: i

    has = .false.
    do i = 1, self%number
      if (self%list(i)%subject == subject) has = .true.
    end do
  end function has

  !> Different warnings so far.
  pure integer function count_warnings(self)
    class(warnings_type), intent(in) :: self  !! the warnings
    count_warnings = self%number
  end function count_warnings

  !> The text of one of them.
  pure function line(self, i) result(text)
    class(warnings_type), intent(in) :: self  !! the warnings
    integer, intent(in) :: i                  !! which one, 1 to `count()`
    character(:), allocatable :: text
    text = self%list(i)%text
  end function line

  !> All as they are kept, a line for each: how many times, a blank, the text of the first. ''
  !> without any.
  pure function all_lines(self) result(text)
    class(warnings_type), intent(in) :: self  !! the warnings
    character(:), allocatable :: text
    integer :: i

    text = ''
    do i = 1, self%number
      text = text//to_text(self%list(i)%times)//' '//self%list(i)%text//newline
    end do
  end function all_lines

  !> Keep the warnings, or put them back.
  subroutine keep_warnings(self, archive)
    class(warnings_type), intent(inout) :: self    !! the warnings; in reading those of the archive
                                                   !! on return
    class(archive_type), intent(inout) :: archive  !! to write to or to read from; its `error` is
                                                   !! set if that fails
    integer :: i

    if (.not. allocated(self%list)) allocate (self%list(most))
    call archive%keep('warnings', self%number)
    if (allocated(archive%error)) return
    do i = 1, self%number
      call archive%keep('subject', self%list(i)%subject)
      call archive%keep('text', self%list(i)%text)
      call archive%keep('times', self%list(i)%times)
    end do
  end subroutine keep_warnings

end module pd_base_warnings
