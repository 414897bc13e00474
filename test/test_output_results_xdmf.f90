!> The list of outputs beside the HDF5 file: well formed at any moment, and true.
module test_output_results_xdmf
  use pd_base_error, only: failure_type => error_type
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: newline, to_text
  use pd_output_results_datasets, only: get_shape, read_rows
  use pd_output_results_description, only: names_of_files
  use pd_output_results_files, only: file_bytes, file_exists
  use pd_output_results_hdf5, only: close_file, hdf5_file, object_exists, open_file
  use pd_output_results_results, only: column_type, field_type, results_type
  use pd_output_results_types, only: kept_type
  use pd_output_results_views, only: view_of_output, view_type, views_fit, views_of
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_output_results_xdmf

  character(*), parameter :: here = 'build/test_output_results_xdmf'
  integer, parameter :: n = 6             !! points
  integer, parameter :: views_of_one = 6  !! displacement, damage, four components of stress

contains

  subroutine collect_output_results_xdmf(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)

    testsuite = [ &
      & new_unittest('the check of XML finds faults', faulty_xml), &
      & new_unittest('views of scalars, vectors and tensors', names_of_views), &
      & new_unittest('the list is whole after every output', after_every_output), &
      & new_unittest('more outputs than planned', more_than_planned), &
      & new_unittest('fewer outputs than planned', fewer_than_planned), &
      & new_unittest('an output that was not completed', incomplete), &
      & new_unittest('a stopped run is cut back', cut_back), &
      & new_unittest('a stopped run gets more room', more_room), &
      & new_unittest('a run without outputs', no_output), &
      & new_unittest('names that XML does not take as they are', strange_names), &
      & new_unittest('an older list goes with its results', older_list), &
      & new_unittest('too many outputs for views', too_many), &
      & new_unittest('names of the files', names)]
  end subroutine collect_output_results_xdmf

  !> Value of component `c` at point `i` in output `k`.
  pure elemental real(wp) function value(k, i, c)
    integer, intent(in) :: k, i, c
    value = 100*k + 10*i + c + 0.25_wp
  end function value

  !> Begin results with a vector, a scalar and a tensor of four components.
  subroutine begin(results, stem, planned, failure, kept, format, precision)
    type(results_type), intent(inout) :: results
    character(*), intent(in) :: stem
    integer, intent(in) :: planned
    type(failure_type), allocatable, intent(out) :: failure
    type(kept_type), intent(in), optional :: kept
    character(*), intent(in), optional :: format, precision
    real(wp) :: positions(n, 3)
    type(column_type) :: columns(0)
    character(8) :: the_format, the_precision
    integer :: i

    the_format = 'vtkhdf'
    if (present(format)) the_format = format
    the_precision = 'double'
    if (present(precision)) the_precision = precision
    positions = 0.0_wp
    positions(:, 1) = [(real(i, wp), i=1, n)]
    call results%create(here, stem, positions, [field_type('displacement', 3, 'm', 'x y z'), &
      & field_type('damage', 1, '1'), field_type('stress', 4, 'Pa', 'xx yy zz xy')], planned, &
      & columns, 0, trim(the_precision), trim(the_format), '&scene /', 'perifort run', '1.2.3', &
      & .true., failure, kept)
  end subroutine begin

  !> Write outputs `first` .. `last`; with `but_end` the last one is not completed.
  subroutine write_outputs(results, first, last, failure, but_end)
    type(results_type), intent(inout) :: results
    integer, intent(in) :: first, last
    type(failure_type), allocatable, intent(inout) :: failure
    logical, intent(in), optional :: but_end
    integer :: k, i, c

    do k = first, last
      if (.not. allocated(failure)) call results%begin_output(0.5_wp*k, failure)
      if (.not. allocated(failure)) call results%put_field(1, &
        & reshape([((value(k, i, c), i=1, n), c=1, 3)], [n, 3]), failure)
      if (.not. allocated(failure)) &
        & call results%put_field(2, [(value(k, i, 4), i=1, n)], failure)
      if (.not. allocated(failure)) call results%put_field(3, &
        & reshape([((value(k, i, c), i=1, n), c=5, 8)], [n, 4]), failure)
      if (present(but_end) .and. k == last) exit
      if (.not. allocated(failure)) call results%end_output(failure)
    end do
  end subroutine write_outputs

  subroutine read_text(path, text)
    character(*), intent(in) :: path
    character(:), allocatable, intent(out) :: text
    integer :: unit

    allocate (character(max(0_i8, file_bytes(path))) :: text)
    if (len(text) == 0) return
    open (newunit=unit, file=path, access='stream', form='unformatted', action='read')
    read (unit) text
    close (unit)
  end subroutine read_text

  !> Take processing instructions out of an XML text and check that it is well formed: elements end
  !> in the order in which they begin, there is one root, values of attributes are quoted, and no
  !> letter stands where it may not. `fault` is '' if it is.
  subroutine read_xml(text, plain, fault)
    character(*), intent(in) :: text
    character(:), allocatable, intent(out) :: plain, fault
    character(:), allocatable :: open_names, tag, name
    integer :: at, end_at, blank, roots

    plain = ''
    fault = ''
    open_names = ' '  ! names of open elements, the innermost first, each followed by a blank
    roots = 0
    at = 1
    do while (at <= len(text))
      if (text(at:at) /= '<') then
        end_at = index(text(at:)//'<', '<') + at - 2
        if (open_names == '' .and. verify(text(at:end_at), ' '//newline) > 0) fault = 'text outside'
        call check_text(text(at:end_at))
        plain = plain//text(at:end_at)
        at = end_at + 1
      else if (index(text(at:), '<?') == 1) then
        end_at = index(text(at:), '?>') + at
        if (end_at == at) fault = 'an instruction without end'
        at = end_at + 1
      else
        end_at = index(text(at:), '>') + at - 1
        if (end_at < at) fault = 'a tag without end'
        if (fault /= '') return
        tag = text(at + 1:end_at - 1)
        plain = plain//text(at:end_at)
        at = end_at + 1
        if (tag(:1) == '/') then
          if (index(open_names, tag(2:)//' ') /= 1) fault = tag//' ends what is not open'
          open_names = open_names(min(len(tag), len(open_names)) + 1:)
          if (len(open_names) == 0) open_names = ' '
        else
          call check_attributes(tag)
          if (open_names == '') roots = roots + 1
          blank = scan(tag//' ', ' /')
          name = tag(:blank - 1)
          if (tag(len(tag):) /= '/') open_names = name//' '//open_names
        end if
      end if
      if (fault /= '') return
    end do
    if (open_names /= '') fault = trim(open_names)//' does not end'
    if (roots /= 1) fault = to_text(roots)//' roots'
  contains
    subroutine check_attributes(tag)
      character(*), intent(in) :: tag
      character(:), allocatable :: rest
      integer :: first, second

      if (scan(tag, '<') > 0) fault = 'a tag within a tag'
      rest = tag(scan(tag//' ', ' '):)
      do
        first = index(rest, '="')
        if (first == 0) exit
        second = index(rest(first + 2:), '"')
        if (second == 0) then
          fault = 'a value without end'
          return
        end if
        call check_text(rest(first + 2:first + second))
        rest = rest(first + 2 + second:)
      end do
      if (verify(rest, ' /') > 0) fault = 'what is '//rest//' in '//tag
    end subroutine check_attributes

    subroutine check_text(part)
      character(*), intent(in) :: part
      integer :: i

      do i = 1, len(part)
        if (part(i:i) /= '&') cycle
        if (index(part(i:), '&amp;') /= 1 .and. index(part(i:), '&lt;') /= 1 .and. &
          & index(part(i:), '&quot;') /= 1) fault = 'a bare &'
      end do
    end subroutine check_text
  end subroutine read_xml

  !> How often `word` is in `text`.
  pure integer function times_in(text, word)
    character(*), intent(in) :: text, word
    integer :: at, next

    times_in = 0
    at = 1
    do
      next = index(text(at:), word)
      if (next == 0) return
      times_in = times_in + 1
      at = at + next - 1 + len(word)
    end do
  end function times_in

  !> The list of `stem` has just `outputs` outputs, with their times, and refers to their values.
  subroutine check_list(error, stem, outputs, finished, single)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: stem
    integer, intent(in) :: outputs
    logical, intent(in) :: finished
    logical, intent(in), optional :: single
    type(failure_type), allocatable :: failure
    type(hdf5_file) :: file
    character(:), allocatable :: text, plain, fault, precision
    real(wp) :: time
    integer :: k, c, at, length
    character(2), parameter :: labels(4) = ['xx', 'yy', 'zz', 'xy']

    if (allocated(error)) return
    precision = '"8"'
    if (present(single)) precision = '"4"'
    call check(error, .not. file_exists(here//'/'//stem//'.xdmf.part'), 'a part is left behind')
    if (allocated(error)) return
    call read_text(here//'/'//stem//'.xdmf', text)
    call read_xml(text, plain, fault)
    call check(error, fault, '')
    if (allocated(error)) return
    call check(error, finished .eqv. times_in(text, '<?') == 1, 'finished or not')
    if (allocated(error)) return
    call check(error, times_in(plain, '<Grid Name="points"'), outputs, 'outputs that are listed')
    if (allocated(error)) return
    call check(error, times_in(plain, '<Attribute '), views_of_one*outputs, 'fields')
    if (allocated(error)) return
    call check(error, times_in(plain, 'Precision='//precision) >= views_of_one*outputs, 'precision')
    if (allocated(error)) return
    call open_file(here//'/'//stem//'.vtkhdf', .false., file, failure)
    call check(error, .not. allocated(failure), 'no file')
    if (allocated(error)) return
    at = 1
    do k = 0, outputs - 1
      at = at + index(plain(at:), '<Time Value="') + 12
      length = index(plain(at:), '"') - 1
      read (plain(at:at + length - 1), *) time
      call check(error, abs(time - 0.5_wp*k) <= 0.0_wp, 'time of output '//to_text(k))
      if (allocated(error)) exit
      call next_reference('/VTKHDF/Vertices/Connectivity')
      if (allocated(error)) exit
      call next_reference('/VTKHDF/Points')
      if (.not. allocated(error)) call expect_values('/outputs/displacement/', 3, 1)
      if (.not. allocated(error)) call expect_values('/outputs/damage/', 1, 4)
      do c = 1, 4
        if (.not. allocated(error)) call expect_values('/outputs/stress/'//labels(c)//'/', 1, 4 + c)
      end do
      if (allocated(error)) exit
    end do
    call close_file(file, failure)
  contains
    !> The next reference of the list is to `path`.
    subroutine next_reference(path)
      character(*), intent(in) :: path

      at = at + index(plain(at:), '.vtkhdf:') + 7
      length = index(plain(at:), '<') - 1
      call check(error, plain(at:at + length - 1), path)
      if (allocated(error)) return
      call check(error, object_exists(file, path), path//' is not there')
    end subroutine next_reference

    !> It is to this output's dataset in `folder`, whose values begin with component `first`.
    subroutine expect_values(folder, components, first)
      character(*), intent(in) :: folder
      integer, intent(in) :: components, first
      character(:), allocatable :: path
      character(6) :: number
      real(wp) :: values(components, n), scalars(n)
      integer(i8) :: rows
      integer :: found, i, j

      write (number, '(i6.6)') k
      path = folder//number
      call next_reference(path)
      if (allocated(error)) return
      call get_shape(file, path, found, rows, failure)
      call check(error, found == components .and. rows == n, 'shape of '//path)
      if (allocated(error)) return
      if (components == 1) then
        call read_rows(file, path, 0_i8, scalars, failure)
        values(1, :) = scalars
      else
        call read_rows(file, path, 0_i8, values, failure)
      end if
      call check(error, .not. allocated(failure), path//' cannot be read')
      if (allocated(error)) return
      do i = 1, n
        do j = 1, components
          call check(error, values(j, i), value(k, i, first + j - 1), path, thr=0.0_wp)
          if (allocated(error)) return
        end do
      end do
    end subroutine expect_values
  end subroutine check_list

  subroutine accept(error, failure)
    type(error_type), allocatable, intent(inout) :: error
    type(failure_type), allocatable, intent(in) :: failure
    if (allocated(failure) .and. .not. allocated(error)) call test_failed(error, failure%message)
  end subroutine accept

  subroutine faulty_xml(error)
    type(error_type), allocatable, intent(out) :: error
    character(60), parameter :: good(3) = [character(60) :: '<?xml version="1.0"?> <a/>', &
      & '<a b="1 &amp; 2"><?x ?><c>text</c></a>', '<a><?x <b> ?><c/></a>']
    character(60), parameter :: bad(9) = [character(60) :: '<a><b></a></b>', '<a>', '<a></a></a>', &
      & '<a/><b/>', '<a b="1></a>', '<a><?x </a>', '<a>&</a>', '<a b=1></a>', '<a/> text']
    character(:), allocatable :: plain, fault
    integer :: i

    do i = 1, size(good)
      call read_xml(trim(good(i)), plain, fault)
      call check(error, fault, '', trim(good(i)))
      if (allocated(error)) return
    end do
    do i = 1, size(bad)
      call read_xml(trim(bad(i)), plain, fault)
      call check(error, fault /= '', 'passes: '//trim(bad(i)))
      if (allocated(error)) return
    end do
  end subroutine faulty_xml

  subroutine names_of_views(error)
    type(error_type), allocatable, intent(out) :: error
    type(view_type), allocatable :: views(:)

    views = views_of([field_type('damage', 1, '1'), field_type('u', 3, 'm', 'x y z'), &
      & field_type('principal', 3, 'Pa', '1 2 3'), field_type('F', 4, '1')])
    call check(error, size(views), 9)
    if (allocated(error)) return
    call check(error, trim(views(2)%name)//trim(views(5)%name)//trim(views(9)%name), &
      & 'uprincipal_3F_4')
    if (allocated(error)) return
    call check(error, all(views%component == [0, 0, 1, 2, 3, 1, 2, 3, 4]))
    if (allocated(error)) return
    call check(error, view_of_output(views(4), 17_i8), '/outputs/principal/2/000017')
  end subroutine names_of_views

  !> During the run, too: what is not complete is not there.
  subroutine after_every_output(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results
    integer :: k

    call begin(results, 'every', 5, failure)
    do k = 0, 3
      call write_outputs(results, k, k, failure)
      call accept(error, failure)
      call check_list(error, 'every', k + 1, .false.)
      if (allocated(error)) return
    end do
    call write_outputs(results, 4, 4, failure)
    call results%close(failure)
    call accept(error, failure)
    call check_list(error, 'every', 5, .true.)
  end subroutine after_every_output

  !> The room is doubled, from an unknown number too, in single precision too.
  subroutine more_than_planned(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results
    integer :: k

    call begin(results, 'more', 2, failure)
    do k = 0, 8
      call write_outputs(results, k, k, failure)
      call accept(error, failure)
      call check_list(error, 'more', k + 1, .false.)
      if (allocated(error)) return
    end do
    call results%close(failure)
    call accept(error, failure)
    call check_list(error, 'more', 9, .true.)
    if (allocated(error)) return
    call begin(results, 'unknown', 0, failure, precision='single')
    call write_outputs(results, 0, 19, failure)
    if (.not. allocated(failure)) call results%close(failure)
    call accept(error, failure)
    call check_list(error, 'unknown', 20, .true., single=.true.)
  end subroutine more_than_planned

  !> Room that was not needed goes, views of it too.
  subroutine fewer_than_planned(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results
    type(hdf5_file) :: file

    call begin(results, 'fewer', 30, failure)
    call write_outputs(results, 0, 2, failure)
    if (.not. allocated(failure)) call results%close(failure)
    call accept(error, failure)
    call check_list(error, 'fewer', 3, .true.)
    if (allocated(error)) return
    call open_file(here//'/fewer.vtkhdf', .false., file, failure)
    call check(error, all([object_exists(file, '/outputs/stress/xy/000002'), &
      & .not. object_exists(file, '/outputs/stress/xy/000003'), &
      & .not. object_exists(file, '/outputs/displacement/000029')]), 'views of no output')
    call close_file(file, failure)
  end subroutine fewer_than_planned

  subroutine incomplete(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results

    call begin(results, 'incomplete', 4, failure)
    call write_outputs(results, 0, 2, failure, but_end=.true.)
    call accept(error, failure)
    call check_list(error, 'incomplete', 2, .false.)
    if (allocated(error)) return
    call results%close(failure)
    call accept(error, failure)
    call check_list(error, 'incomplete', 2, .true.)
  end subroutine incomplete

  !> Five outputs are left, the checkpoint counts three: the run goes on after them.
  subroutine cut_back(error)
    type(error_type), allocatable, intent(out) :: error
    call go_on(error, 'cut', 6, 6)
  end subroutine cut_back

  !> The same with a list that has no room for the rest of the run.
  subroutine more_room(error)
    type(error_type), allocatable, intent(out) :: error
    call go_on(error, 'room', 5, 12)
  end subroutine more_room

  subroutine go_on(error, stem, before, after)
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in) :: stem
    integer, intent(in) :: before, after
    type(failure_type), allocatable :: failure
    type(results_type) :: results
    type(kept_type) :: kept

    call begin(results, stem, before, failure)
    call write_outputs(results, 0, 4, failure)
    if (.not. allocated(failure)) call results%close(failure, stopped=.true.)
    call accept(error, failure)
    call check_list(error, stem, 5, .false.)
    if (allocated(error)) return
    allocate (kept%rows(0, 0))
    kept%times = [0.0_wp, 0.5_wp, 1.0_wp]
    kept%scene_text = '&scene /'
    call begin(results, stem, after, failure, kept)
    call accept(error, failure)
    call check_list(error, stem, 3, .false.)
    if (allocated(error)) return
    call write_outputs(results, 3, after - 1, failure)
    if (.not. allocated(failure)) call results%close(failure)
    call accept(error, failure)
    call check_list(error, stem, after, .true.)
    if (allocated(error)) return
    ! finished files go on, too
    call begin(results, stem, after + 1, failure, kept)
    call accept(error, failure)
    call check_list(error, stem, 3, .false.)
    if (allocated(error)) return
    call results%close(failure)
    call accept(error, failure)
    call check_list(error, stem, 3, .true.)
    if (allocated(error)) return
    ! back to before the first output: there is nothing to list
    kept%times = kept%times(:0)
    call begin(results, stem, after, failure, kept)
    call accept(error, failure)
    if (allocated(error)) return
    call check(error, .not. file_exists(here//'/'//stem//'.xdmf'), 'a list of nothing')
    if (allocated(error)) return
    call write_outputs(results, 0, 0, failure)
    call accept(error, failure)
    call check_list(error, stem, 1, .false.)
    call results%close(failure)
  end subroutine go_on

  subroutine no_output(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results

    call begin(results, 'none', 4, failure)
    call write_outputs(results, 0, 0, failure, but_end=.true.)
    if (.not. allocated(failure)) call results%close(failure)
    call accept(error, failure)
    if (allocated(error)) return
    call check(error, .not. any([file_exists(here//'/none.xdmf'), &
      & file_exists(here//'/none.xdmf.part')]), 'a list of nothing')
  end subroutine no_output

  subroutine strange_names(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results
    character(:), allocatable :: text

    call begin(results, 'this&that <1>', 2, failure)
    call write_outputs(results, 0, 1, failure)
    if (.not. allocated(failure)) call results%close(failure)
    call accept(error, failure)
    call check_list(error, 'this&that <1>', 2, .true.)
    if (allocated(error)) return
    call read_text(here//'/this&that <1>.xdmf', text)
    call check(error, index(text, '>this&amp;that &lt;1>.vtkhdf:/outputs/') > 0, 'name')
    if (allocated(error)) return
    ! readers take what is before a colon for the name
    call begin(results, 'a:b', 2, failure)
    call write_outputs(results, 0, 1, failure)
    if (.not. allocated(failure)) call results%close(failure)
    call accept(error, failure)
    if (allocated(error)) return
    call check(error, file_exists(here//'/a:b.vtkhdf') .and. .not. file_exists(here//'/a:b.xdmf'), &
      & 'a list that readers cannot follow')
  end subroutine strange_names

  !> The list of an earlier run stays as long as its results, and no longer.
  subroutine older_list(error)
    type(error_type), allocatable, intent(out) :: error
    type(failure_type), allocatable :: failure
    type(results_type) :: results

    call begin(results, 'older', 3, failure)
    call write_outputs(results, 0, 2, failure)
    if (.not. allocated(failure)) call results%close(failure)
    call accept(error, failure)
    call begin(results, 'older', 3, failure)
    call write_outputs(results, 0, 0, failure, but_end=.true.)
    call accept(error, failure)
    if (allocated(error)) return
    call check(error, file_exists(here//'/older.xdmf'), 'it goes before there are new results')
    if (allocated(error)) return
    call results%end_output(failure)
    call accept(error, failure)
    call check_list(error, 'older', 1, .false.)
    call results%close(failure)
    if (allocated(error)) return
    call begin(results, 'older', 3, failure, format='vtu')
    call write_outputs(results, 0, 0, failure)
    if (.not. allocated(failure)) call results%close(failure)
    call accept(error, failure)
    if (allocated(error)) return
    call check(error, .not. file_exists(here//'/older.xdmf'), 'a list of files that have gone')
  end subroutine older_list

  !> A file is not filled with views; then there is no list. One that is there from before goes.
  subroutine too_many(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: many = 10000
    type(failure_type), allocatable :: failure
    type(results_type) :: results
    type(kept_type) :: kept
    type(hdf5_file) :: file

    call check(error, views_fit([field_type('damage', 1, '1')], int(many, i8)) .and. &
      & .not. views_fit(spread(field_type('damage', 1, '1'), 1, views_of_one), int(many, i8)), &
      & 'the limit is elsewhere')
    if (allocated(error)) return
    call begin(results, 'too_many', many, failure)
    call write_outputs(results, 0, 1, failure)
    if (.not. allocated(failure)) call results%close(failure)
    call accept(error, failure)
    if (allocated(error)) return
    call open_file(here//'/too_many.vtkhdf', .false., file, failure)
    call check(error, .not. any([object_exists(file, '/outputs'), &
      & file_exists(here//'/too_many.xdmf'), file_exists(here//'/too_many.xdmf.part')]), 'views')
    call close_file(file, failure)
    if (allocated(error)) return

    call begin(results, 'grown', 3, failure)
    call write_outputs(results, 0, 1, failure)
    if (.not. allocated(failure)) call results%close(failure, stopped=.true.)
    call accept(error, failure)
    call check_list(error, 'grown', 2, .false.)
    if (allocated(error)) return
    allocate (kept%rows(0, 0))
    kept%times = [0.0_wp, 0.5_wp]
    kept%scene_text = '&scene /'
    call begin(results, 'grown', many, failure, kept)
    call write_outputs(results, 2, 2, failure)
    if (.not. allocated(failure)) call results%close(failure)
    call accept(error, failure)
    if (allocated(error)) return
    call check(error, .not. file_exists(here//'/grown.xdmf'), 'a list without views')
    if (allocated(error)) return
    ! and back: results that are cut to few outputs get views and a list
    call begin(results, 'grown', 4, failure, kept)
    call write_outputs(results, 2, 3, failure)
    if (.not. allocated(failure)) call results%close(failure)
    call accept(error, failure)
    call check_list(error, 'grown', 4, .true.)
  end subroutine too_many

  !> What is announced is what is written.
  subroutine names(error)
    type(error_type), allocatable, intent(out) :: error
    type(field_type) :: fields(1)

    fields = [field_type('damage', 1, '1')]
    call check(error, names_of_files('a', 'vtkhdf', fields, 10), &
      & 'a.vtkhdf, a.xdmf (opens in ParaView and pyvista), history.csv')
    if (allocated(error)) return
    call check(error, names_of_files('a', 'VTU', fields, 10), 'a.pvd with .vtu files, history.csv')
    if (allocated(error)) return
    call check(error, names_of_files('a:b', 'both', fields, 10), &
      & 'a:b.vtkhdf, a:b.pvd with .vtu files, history.csv')
    if (allocated(error)) return
    call check(error, names_of_files('a', 'vtkhdf', fields, 1000000), &
      & 'a.vtkhdf, no a.xdmf for so many outputs, history.csv')
  end subroutine names

end module test_output_results_xdmf
